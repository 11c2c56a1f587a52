"""The way from a contact to BRAKE: which of our functions run, counted on the shipped code.

Two ways begin at the handler that reads the board's socket:

reflex   until the bridge passes its own BRAKE frame to the kernel
judged   until it passes the BRAKE frame of safety's motion: the bridge's part until the bumper
         message goes to Zenoh, safety's from Zenoh's callback until its motion goes to Zenoh, and
         the bridge's from that callback until the frame

Work of the same handler that follows the frame or the message is not on the way, nor is the loop
that calls the handlers.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any
from unittest.mock import patch

from common import codec, keys
from common import messages as m
from verification.cost.paths import ROBOT, STEP_NS, BridgePaths, SafetyPaths
from verification.cost.stand_ins import BoardSocket, Clock, Sink

ROOT = Path(__file__).resolve().parents[2]
OURS = tuple(f"{ROOT / package}/" for package in ("common", "services"))

Step = tuple[str, str]  # file and function
Way = dict[Step, None]  # in the order of the first call


class Trace:
    """Records the functions of ours that run, until a function of the outside is reached."""

    def __init__(self) -> None:
        self.way: Way = {}

    @contextmanager
    def until(self, kind: type[Any], method: str, wanted: Callable[..., bool]) -> Iterator[None]:
        """Record until this method is called with wanted arguments; raise if it never is."""
        original = getattr(kind, method)
        reached = False

        def end(*args: Any, **options: Any) -> Any:
            nonlocal reached
            if wanted(*args):
                reached = True
                sys.setprofile(None)
            return original(*args, **options)

        with patch.object(kind, method, end):
            sys.setprofile(self._on_event)
            try:
                yield
            finally:
                sys.setprofile(None)
        assert reached, f"{kind.__name__}.{method} was not called: the way has changed"

    def _on_event(self, frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(OURS):
            file = str(Path(code.co_filename).relative_to(ROOT))
            self.way[file, code.co_qualname] = None


def reflex() -> Way:
    """Return the way from the board's datagram to the bridge's own BRAKE frame."""
    bridge = BridgePaths(Clock())
    bridge.release_bumper()
    trace = Trace()
    with trace.until(BoardSocket, "sendto", lambda *_: True):
        bridge.take("hit")
    return trace.way


def judged() -> Way:
    """Return the way from the board's datagram to the BRAKE frame of safety's motion."""
    bumper, motion = keys.BUMPER.on(ROBOT), keys.MOTION.on(ROBOT)
    safety, bridge = SafetyPaths(Clock()), BridgePaths(Clock())
    bridge.release_bumper()
    trace = Trace()
    with trace.until(Sink, "put", lambda sink, *_: sink.key == bumper):
        bridge.take("hit")
    safety.clock.install()
    safety.clock.now_ns += STEP_NS
    with trace.until(Sink, "put", lambda sink, *_: sink.key == motion):
        safety.link.deliver_encoded(bumper, bridge.session.sent[bumper], bumper)
    bridge.clock.install()
    bridge.clock.now_ns += STEP_NS
    brake = bridge.from_authority(codec.decode(safety.session.sent[motion], m.Motion))
    payload = codec.encode(brake)
    with trace.until(BoardSocket, "sendto", lambda *_: True):
        bridge.session.deliver_encoded(motion, payload, motion)
    return trace.way
