"""Seeds of the fuzzer: real frames, one of each message, typical settings.

``corpus/`` has further inputs: some with additional coverage, and earlier findings, which have
names.
"""

import json
import math
from collections.abc import Iterator
from pathlib import Path

import msgpack
import msgspec
from msgspec import Struct

from common import messages as m
from common.codec import encode
from common.config import DEFAULT_FILE
from common.motion import Command
from common.wire.frame import Frame
from verification.fuzz.targets import COVERS, FRAMINGS, KINDS
from verification.harness.frame_strategies import COMMANDS, REPORTS

CORPUS = Path(__file__).parent / "corpus"
CAPTURED = Path(__file__).parents[2] / "tests/common/wire/frames.json"

STATE = m.SafetyState(
    verdict="slow",
    latched=("contact",),
    causes=(m.Cause(name="zone", action="slow", age=0.5, text="near: 近"),),
    source="teleop",
    limits=m.Limits(forward=0.1, backward=1.0, angular=0.5),
    heartbeat=7,
    text="slow",
)
EXAMPLES: tuple[Struct, ...] = (
    m.Velocity(linear=-0.5, angular=0.25),
    m.Mileage(distance=12.5, heading=-math.pi, epoch=1),
    m.Ultrasonic(ranges=(1.0, None) * 4, status=("ok", "fault") * 4),
    m.Bumper(pressed=True),
    m.Driver(faults=("overcurrent", "bit_9"), bits=0x201),
    m.Switches(ultrasonic_brake=True, bumper_brake=None),
    m.Link(state="up", board="127.0.0.1:4003", epoch=1, armed=True, waiting="", round_trip=None,
           rates={"bumper": 50.0}, rejected={"bad_crc": 3}, latched_by=2**63 - 1),
    m.Odometry(x=1.0, y=-2.0, heading=0.5, linear=0.1, angular=0.0, pose_covariance=(0.1,) * 9,
               twist_covariance=(0.1,) * 4, epoch=2, residual=None, slip=False),
    STATE,
    m.Health(service="odom", version="0.1.0", uptime=1.5, rates={"a": 1.0}, counters={"b": 2},
             lateness=0.001, rss=2**26),
    m.Event(name="contact", level="error", text="hit", about={"a": 1, "b": None, "c": 0.5}),
    m.Drive(linear=math.nan, angular=math.inf, echo=7),
    m.EstopKeepalive(echo=7),
    m.Limit(linear=math.nan, angular=0.0, echo=7, reason="\x1b[2J"),
    m.Motion(
        command=Command.RUN, linear=0.5, angular=-0.5, source="teleop", judged=9, judged_boot=5
    ),
    m.SwitchesRequest(bumper_brake=True),
    m.LedRequest(channel=9, mode=1),
    m.ResetRequest(),
    m.ReleaseRequest(held=False),
    m.PoseRequest(x=1.0, y=2.0, heading=-0.5),
    m.Done(text="done"),
    m.ResetDone(text="done", boot=7, heartbeat=9, cleared=(41, 42)),
)  # fmt: skip
HOSTILE: tuple[object, ...] = (
    [1, 2],
    {"seq": -(2**63), "boot": 2**64 - 1},
    {"pressed": msgpack.ExtType(5, b"x")},
    {"echo": {}, "linear": "1", "angular": None},
)

SETS = (
    "board.port=4002",
    "board.listen_ports=4002, 4001",
    "board.listen_ports=[4002]",
    "bus.listen=tcp/127.0.0.1:7447,tcp/[::1]:2",
    "bus.connect=",
    "safety.sources={new={priority=5,lease=0.2}}",
    "safety.sources.web.lease=99",
    "safety.unsafe_overrides=margin\0safety.margin=0",
    "odom.hold=5e-2\0log.level=debug",
    "sim.drive.coast=nan",
    "robot.id=t2 \0robot=5",
    "wire.crc=xmodem\0wire.crc_covers=header",
    "board.address=10.7.5.224\0board.port",
    "sim.seed=0x10\0sim.world=1979-05-27T07:32:00Z",
)
TOML = (
    "",
    "[board]\nport = 70000\n",
    '[safety.sources]\nweb = "x"\nnew = { priority = 1, lease = 0.2 }\n',
    "[board]\nlisten_ports = [1, 70000]\n[log]\nlevel = 'loud'\n",
    '[bus]\nlisten = ["tcp/0.0.0.0:7447", """\nudp/h:1"""]\nlease = inf\n',
    "robot = 1979-05-27\nteleop.gears_linear = [0.1, nan]\n",
    "[[sim]]\nworld = '''x'''\nseed = 0b101 # \\u00e9\n",
)


def seeds(target: str) -> Iterator[bytes]:
    """Yield the seeds of a target, without ``corpus/``."""
    yield b""
    yield from {
        "frames": _frames, "messages": _messages, "toml": _toml, "environ": _environ, "sets": _sets,
    }[target]()  # fmt: skip


def found(target: str) -> dict[str, bytes]:
    """Return the committed inputs of a target by name."""
    return {file.name: file.read_bytes() for file in sorted((CORPUS / target).glob("*"))}


def _frames() -> Iterator[bytes]:
    captured = json.loads(CAPTURED.read_text(encoding="utf-8"))["pc_to_board"]
    real = [bytes.fromhex(frame["hex"]) for frame in captured]
    yield from (b"\x01" + raw for raw in real)
    yield b"\x01" + b"".join(real)
    for number in range(2 * len(COVERS)):
        framing = FRAMINGS[number][0]
        made: tuple[Frame, ...] = COMMANDS if number % 2 else REPORTS
        yield from (bytes([number]) + framing.pack(frame) for frame in made)


def _messages() -> Iterator[bytes]:
    for example in EXAMPLES:
        yield bytes([KINDS.index(type(example))]) + encode(example)
    for number in range(len(KINDS)):
        for value in HOSTILE:
            yield bytes([number]) + msgpack.packb(value)
    yield bytes([KINDS.index(m.SafetyState)]) + msgpack.packb(msgspec.to_builtins(STATE))[:-2]


def _toml() -> Iterator[bytes]:
    yield from (text.encode() for text in TOML)
    yield DEFAULT_FILE.read_bytes()


def _sets() -> Iterator[bytes]:
    yield from (text.encode() for text in SETS)


def _environ() -> Iterator[bytes]:
    for text in SETS:
        pairs = (part.partition("=") for part in text.split("\0"))
        yield b"\0".join(
            f"{path.replace('.', '__').upper()}={value}".encode() for path, _, value in pairs
        )
