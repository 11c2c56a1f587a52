"""Seeds of the fuzzer: real frames, one of each message, typical settings.

``corpus/`` has further inputs: earlier findings, with names.
"""

import json
import math
from collections.abc import Iterator, Sequence
from copy import deepcopy
from pathlib import Path
from random import Random
from typing import Any

import msgpack
from msgspec import inspect

from common.config import DEFAULT_FILE
from common.wire import framing
from common.wire.frame import Frame
from verification.fuzz.targets import KINDS, SEPARATOR
from verification.harness.frame_examples import COMMANDS, REPORTS

CORPUS = Path(__file__).parent / "corpus"
CAPTURED = Path(__file__).parents[2] / "tests/common/wire/frames.json"
HOSTILE: tuple[Any, ...] = (
    None, True, -1, 0, 2**63, 2**64 - 1, -(2**63), 0.5, math.nan, math.inf, -math.inf, 5e-324,
    "", "run", "\x00", "近" * 40, b"", b"\xff", [], {}, [None] * 9, {"": {}}, {1: 2},
    msgpack.ExtType(5, b"x"), msgpack.Timestamp(1, 2), [[[[[]]]]],
)  # fmt: skip
PLAIN = {inspect.StrType: "近", inspect.IntType: 5, inspect.FloatType: 0.5, inspect.BoolType: True,
         inspect.BytesType: b"x"}  # fmt: skip
SETS = (
    "board.port=4002",
    "board.listen_ports=4002, 4001",
    "bus.listen=tcp/127.0.0.1:7447,tcp/[::1]:2",
    "safety.sources={new={priority=5,lease=0.2}}",
    "unsafe_overrides=safety.margin\0safety.margin=0",
    "teleop.deadzone=5e-2\0log.level=debug",
    "teleop.deadzone=nan",
    "robot.id=t2 \0robot=5",
    "wire.command_angular_unit=milliradian\0wire.feedback_angular_unit=x",
    "board.address=10.7.5.224\0board.port",
    "sim.seed=0x10\0sim.world=1979-05-27T07:32:00Z",
)
TOML = (
    "",
    "[board]\nport = 70000\n",
    '[safety.sources]\nweb = "x"\nnew = { priority = 1, lease = 0.2 }\n',
    "[board]\nlisten_ports = [1, 70000]\n[log]\nlevel = 'loud'\n",
    '[bus]\nlisten = ["tcp/0.0.0.0:7447", """\nudp/h:1"""]\nlease = inf\n',
    "robot = 1979-05-27\nvehicle.gears_linear = [0.1, nan]\n",
    "[[sim]]\nworld = '''x'''\nseed = 0b101 # \\u00e9\n",
)


def seeds(target: str) -> Iterator[bytes]:
    """Yield the seeds of a target, without ``corpus/``."""
    texts = {"toml": [*TOML, DEFAULT_FILE.read_text(encoding="utf-8")], "sets": SETS}
    made = {"frames": _frames, "messages": _messages, "environ": _environ}
    yield from made[target]() if target in made else map(str.encode, texts[target])


def _frames() -> Iterator[bytes]:
    captured = json.loads(CAPTURED.read_text(encoding="utf-8"))["pc_to_board"]
    real = [bytes.fromhex(frame["hex"]) for frame in captured]
    yield from (b"\x01" + raw for raw in [*real, b"".join(real)])
    made: Sequence[tuple[Frame, ...]] = REPORTS, COMMANDS
    for number, some in enumerate(made):
        yield from (bytes([number]) + framing.pack(frame) for frame in some)


def _messages() -> Iterator[bytes]:
    for number, kind in enumerate(KINDS):
        yield bytes([number]) + msgpack.packb(example(inspect.type_info(kind)))


def _environ() -> Iterator[bytes]:
    for text in SETS:
        pairs = (part.partition("=") for part in text.split("\0"))
        yield SEPARATOR.join(
            f"{path.replace('.', '__').upper()}={value}".encode() for path, _, value in pairs
        )


def example(kind: inspect.Type) -> Any:
    """Return a valid value of a type, with every field and the fewest items of each list."""
    made: Any = _plain(kind)
    match kind:
        case inspect.StructType():
            made = {field.encode_name: example(field.type) for field in kind.fields}
        case inspect.UnionType():
            made = next(filter(None, map(example, kind.types)))
        case inspect.LiteralType():
            made = kind.values[0]
        case inspect.EnumType():
            made = next(iter(kind.cls)).value
        case inspect.VarTupleType():
            made = [example(kind.item_type)] * max(1, kind.min_length or 0)
        case inspect.DictType():
            made = {example(kind.key_type): example(kind.value_type)}
    return made


def _plain(kind: inspect.Type) -> Any:
    """Return a valid value of a type without parts; None of another one."""
    if isinstance(kind, inspect.StrType) and kind.pattern:
        return "a"
    if isinstance(kind, inspect.IntType) and kind.ge:
        return kind.ge
    return PLAIN.get(type(kind))


def mutated(known: Sequence[bytes], random: Random) -> bytes:
    """Return a known message with one to three hostile values, as valid MessagePack."""
    raw = random.choice(known)
    value = msgpack.unpackb(raw[1:])
    for _ in range(random.randint(1, 3)):
        value = _damaged(value, random)
    packed: bytes = msgpack.packb(value)
    return raw[:1] + packed


def _damaged(value: Any, random: Random) -> Any:
    """Replace or remove a value at a random place."""
    if not isinstance(value, dict | list) or not value or random.random() < 0.2:
        return deepcopy(random.choice(HOSTILE))  # a later change may be inside it
    key = random.choice(list(value) if isinstance(value, dict) else range(len(value)))
    if random.random() < 0.1:
        del value[key]
    else:
        value[key] = _damaged(value[key], random)
    return value
