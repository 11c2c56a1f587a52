"""``t2 replay`` on a real bus."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from cli.recordings import replay
from cli.recordings.replay import is_played
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.writer import RecordingWriter
from t2 import keys
from t2 import messages as m
from t2.messages import Command
from tests.cli.inspect.conftest import buses, tool
from tests.cli.inspect.tool import Tool, pretend
from tests.common.bus_fixture import BusFixture
from tests.recorder import samples
from tests.recorder.samples import bare, sample
from verification.harness.waiting import wait_until

__all__ = ["buses", "tool"]

FAST = ("--rate", "1000")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A recording of five seconds, with every kind of message that must not be played."""
    made = RecordingWriter(tmp_path / "a.mcap", Encoder(Vehicle()))
    for second in range(5):
        made.write(
            sample("tel/bridge/velocity", samples.velocity(second), second, raw=b"%d" % second)
        )
        made.write(sample("@cmd/motion", m.Motion(command=Command.RUN, linear=1.0), second))
        made.write(
            sample("@cmd/drive/demo", m.Drive(linear=second / 10, angular=0, echo=1), second)
        )
    made.write(bare("@cmd/drive/demo", b"\xc1", at_s=4.5))
    made.write(bare("tel/mine", b"gone", at_s=4.5, deleted=True))
    made.write(bare("estop", b"", at_s=5.0))
    made.write(bare("tel/mine", b"last", at_s=5.0))
    made.close()
    return made.path


@pytest.fixture
def came(buses: BusFixture) -> Iterator[list[zenoh.Sample]]:
    """All samples that arrive on the robot's keys."""
    found: list[zenoh.Sample] = []
    session = buses.session()
    declared = [
        session.declare_subscriber(f"t2/v1/{buses.robot}/{each}", found.append)
        for each in ("**", "@cmd/**")
    ]
    yield found
    for each in declared:
        each.undeclare()


def shown(came: list[zenoh.Sample]) -> list[tuple[str, bytes, bytes]]:
    return [
        (
            str(each.key_expr).split("/", 3)[3],
            each.payload.to_bytes(),
            each.attachment.to_bytes() if each.attachment else b"",
        )
        for each in came
    ]


def test_replay_publishes_the_original_bytes_without_actuation(
    path: Path, came: list[zenoh.Sample], tool: Tool
) -> None:
    result = tool("replay", str(path), *FAST)
    assert (result.code, result.err) == (0, "played 6 messages\n")
    wait_until(lambda: len(came) >= 6, "six messages")
    whole = [sample("tel/bridge/velocity", samples.velocity(second), second) for second in range(5)]
    assert shown(came) == [
        *(("tel/bridge/velocity", one.payload, b"%d" % n) for n, one in enumerate(whole)),
        ("tel/mine", b"last", b""),
    ]
    assert str(came[0].encoding) == whole[0].encoding


def test_only_the_selected_keys_are_played(path: Path, tool: Tool) -> None:
    for words, played in (("--only @cmd/**", 0), ("--only velocity --only tel/mine", 6)):
        result = tool("replay", str(path), *words.split(), *FAST)
        assert (result.code, result.err) == (int(not played), f"played {played} messages\n")


def test_refused_while_the_bridge_runs(
    path: Path, came: list[zenoh.Sample], buses: BusFixture, tool: Tool
) -> None:
    pretend(buses, "bridge", {})
    result = tool("replay", str(path), *FAST)
    assert result.code == 1
    assert f"robot {buses.robot} has a running bridge" in result.err
    assert tool("replay", str(path), *FAST, robot="nobody").code == 0
    assert came == []


def test_a_service_that_starts_ends_the_replay(
    path: Path, buses: BusFixture, tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    play = replay.Player.play

    def start_safety(self: replay.Player, path: str, it: Any) -> bool:
        if path == "tel/bridge/velocity":
            pretend(buses, "safety", {})
            monkeypatch.setattr(replay.Player, "play", play)
        return play(self, path, it)

    monkeypatch.setattr(replay.Player, "play", start_safety)
    result = tool("replay", str(path), "--rate", "0.5")
    assert result.code == 1
    assert f"robot {buses.robot} has a running safety" in result.err


NAMES = {"service": "odom", "side": "left", "source": "web", "camera": "front"}
PATHS = [topic.path.format(**NAMES) for topic in keys.TOPICS]


def test_what_is_played_onto_the_bus() -> None:
    """Nothing that moves or stops the vehicle, and no stream of a running service."""
    assert [path for path in PATHS if not is_played(path, ())] == [p for p in PATHS if p[0] == "@"]
    assert not any(is_played(path, ()) for path in ("@new", "a/@b", "estop"))
    assert is_played("tel/mine", ())
    paths = ["tel/odom/odometry", "evt/odom", "tel/bridge/velocity", "tel/odometer/x", "srv/odom"]
    assert [is_played(path, ["odom"]) for path in paths] == [False, False, True, True, True]
