"""What a recorder sees of the simulated stack, as samples and as a file."""

from collections.abc import Iterable
from pathlib import Path

from cli.inspect.addressing import chunks
from cli.recordings.safety_inputs import Recorded, is_input
from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.writer import RecordingWriter
from t2 import codec, keys
from t2 import messages as m
from t2.codec import Sample
from verification.search.bus import ROBOT, Envelope, Subscription
from verification.search.stack import Stack

WALL_NS = 1_700_000_000 * NS_PER_S  # of the stack's time 0
# From sending to the recorder. Requests and emergency stops come through the router as they come
# to safety, so they follow the motion of the same instant.
MOTION_NS, OTHERS_NS = 200_000, 500_000


class Tap:
    """A recorder of a simulated stack."""

    def __init__(self, stack: Stack) -> None:
        self.samples: list[Sample] = []
        self._stack = stack
        process = stack.process("recorder")
        for topic in keys.TOPICS:
            names = dict.fromkeys(("side", "source", "service", "camera"), "*")
            key = topic.on(ROBOT, **names)
            stack.net.subscribe(Subscription(process, key, self._take, depth=1000))
        stop = keys.estop_key(ROBOT)
        stack.net.subscribe(Subscription(process, stop, self._take, depth=1000))

    @property
    def recorded(self) -> list[Recorded]:
        """The messages that a replay needs."""
        found = []
        for one in self.samples:
            path, kind = chunks(one.key)[1], codec.kind_of(one.encoding)
            if is_input(path, kind):
                message = codec.decode(one.payload, getattr(m, kind)) if kind else None
                found.append(Recorded(path, message, one.wall_ns))
        return found

    def _take(self, envelope: Envelope) -> None:
        is_estop = envelope.key == keys.estop_key(ROBOT)
        message = envelope.message
        late_ns = MOTION_NS if isinstance(message, m.Motion) else OTHERS_NS
        at_ns = self._stack.net.now_ns + late_ns
        self.samples.append(
            Sample(
                key=envelope.key,
                payload=b"" if is_estop else codec.encode(message),
                encoding="" if is_estop else codec.encoding(type(message)),
                deleted=False,
                raw=None,
                received_ns=at_ns,
                wall_ns=at_ns + WALL_NS,
            )
        )


def written(path: Path, samples: Iterable[Sample]) -> Path:
    """Write samples to a recording; return its path."""
    writer = RecordingWriter(path, Encoder(Vehicle()))
    for sample in samples:
        writer.write(sample)
    writer.close()
    return path


def drive(stack: Stack, linear: float = 0.0, angular: float = 0.0) -> None:
    """Let teleop request a twist from now on."""
    stack.sources["teleop"].message = m.Drive(echo=0, linear=linear, angular=angular)


def reset(stack: Stack) -> None:
    """Let go, wait until the vehicle stands, and reset between two messages of the sources."""
    drive(stack)
    stack.run(1020)
    assert stack.reset().done
    stack.run(475)
