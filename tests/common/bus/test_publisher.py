"""Publishing: the message header, the stored samples and the Zenoh settings."""

from collections import Counter
from pathlib import Path
from typing import Any, cast

import msgpack
import pytest
import zenoh

from common.bus.publisher import Publisher, host_id
from t2 import keys
from t2.messages import Bumper, Command, Motion


def test_it_numbers_and_stamps_even_without_a_bus() -> None:
    counts: Counter[str] = Counter()
    publisher = Publisher(keys.BUMPER, "t2/v1/001/tel/bridge/bumper", 77, counts, 5)
    first = publisher.put(Bumper(pressed=False, seq=900, boot=1))  # its own header is replaced
    second = publisher.put(Bumper(pressed=True))
    assert (first.seq, second.seq) == (1, 2)
    assert first.boot == second.boot == 77
    assert first.host == second.host == 5
    assert first.mono_ns <= second.mono_ns
    assert first.t_ns > 1_500_000_000 * 10**9  # a wall clock, in nanoseconds
    assert publisher.last is second
    assert second.pressed
    assert not counts  # nothing was sent


class Session:
    """Takes what is sent, in Zenoh's place."""

    def __init__(self) -> None:
        self.sent: list[dict[str, Any]] = []

    def declare_publisher(self, _: str, **__: object) -> "Session":
        return self

    def put(self, payload: bytes, attachment: bytes | None) -> None:
        self.sent.append(msgpack.unpackb(payload) | {"raw": attachment})


def test_a_motion_never_waits_for_a_bus() -> None:
    counts: Counter[str] = Counter()
    publisher = Publisher(keys.MOTION, "k", 77, counts)
    session = Session()
    publisher.put(Motion(command=Command.RUN, linear=1.0))
    publisher.declare(cast(zenoh.Session, session))
    assert session.sent == []
    publisher.put(Motion(command=Command.STOP), b"raw")
    assert [(sent["seq"], sent["command"], sent["raw"]) for sent in session.sent] == [
        (2, "stop", b"raw")
    ]
    publisher.withdraw()
    publisher.put(Motion(command=Command.RUN))
    publisher.declare(cast(zenoh.Session, session))
    assert counts["k"] == len(session.sent) == 1


# --- the host, whose clock a message names ------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "host"),
    [
        ("ffffffff-ffff-ffff-0000-000000000000\n", 2**63 - 1),
        ("00000000-0000-0002-ffff-ffffffffffff\n", 1),
        (None, 0),
        ("", 0),
        ("no such thing", 0),
    ],
)
def test_the_id_is_made_of_the_boots_own_name(tmp_path: Path, text: str | None, host: int) -> None:
    file = tmp_path / "boot_id"
    if text is not None:
        file.write_text(text, encoding="ascii")
    assert host_id(file) == host
