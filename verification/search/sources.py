"""Sources on the bus: sticks that request motion, sources of speed limits, and a pendant."""

from typing import Any

from msgspec.structs import replace

from common import keys
from common import messages as m
from verification.search.bus import ROBOT, Process

PENDANT = "pendant"


class Source:
    """Echoes safety's heartbeat; ``publish`` is called 20 times a second."""

    topic: keys.Topic[Any]

    def __init__(self, name: str, process: Process) -> None:
        self.name = name
        self.process = process
        self.echo = 0
        self.seq = 0
        process.subscribe(keys.SAFETY, self._listen)

    def _listen(self, arrival: Any) -> None:
        self.echo = arrival.message.heartbeat

    def put(self, message: m.SourceMessage, *, name: str = "", step: int = 1) -> None:
        """Put any message, with the next number unless ``step`` says otherwise."""
        self.seq += step
        boot = message.boot or self.process.boot
        key = self.topic.on(ROBOT, source=name or self.name)
        self.process.post(key, replace(message, boot=boot, seq=self.seq))

    def publish(self) -> None:
        """Publish what is set, if anything is."""
        raise NotImplementedError


class Stick(Source):
    """Requests motion while ``requested`` is set."""

    topic = keys.DRIVE
    requested: tuple[float, float] | None = None  # m/s, rad/s

    def publish(self) -> None:
        if self.requested is not None:
            linear, angular = self.requested
            self.put(m.Drive(linear=linear, angular=angular, echo=self.echo))


class Limiter(Source):
    """Limits the speed while ``caps`` is set; None in it leaves an axis unlimited."""

    topic = keys.LIMIT
    caps: tuple[float | None, float | None] | None = None  # m/s, rad/s

    def publish(self) -> None:
        if self.caps is not None:
            linear, angular = self.caps
            self.put(m.Limit(linear=linear, angular=angular, echo=self.echo))


class Pendant(Source):
    """Publishes signs of life while it is alive."""

    topic = keys.ESTOP_KEEPALIVE
    alive = True

    def publish(self) -> None:
        if self.alive:
            self.put(m.EstopKeepalive(echo=self.echo))
