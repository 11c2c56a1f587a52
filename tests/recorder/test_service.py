"""The recorder on a real bus: recordings, disk errors and SIGKILL."""

import errno
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest

from common.config import Sources, load
from common.freshness import NS_PER_S
from common.service import Node
from services.recorder import recorder as recorder_module
from services.recorder.blackbox import BlackBox
from services.recorder.config import RecorderConfig
from services.recorder.mcap_codec import Entry
from services.recorder.reader import Reader
from services.recorder.recorder import Recorder
from services.recorder.storage import MB
from services.recorder.writer import RecordingWriter
from t2 import codec, keys
from t2 import messages as m
from t2.messages import Event
from tests.cli.inspect.tool import Tool, pretend
from tests.common.bus_fixture import BusFixture, until_received
from tests.recorder import samples
from verification.harness.bus import running
from verification.harness.host import StallRecorder
from verification.harness.waiting import PATIENCE_S, wait_until


@pytest.fixture(autouse=True)
def _short_tail(monkeypatch: pytest.MonkeyPatch) -> None:
    box = partial(BlackBox, tail_ns=NS_PER_S // 5)
    monkeypatch.setattr(recorder_module, "BlackBox", box)


def sets(buses: BusFixture, folder: Path, *more: str) -> list[str]:
    return [
        f"bus.connect={buses.endpoint}",
        f"robot.id={buses.robot}",
        f"recorder.folder={folder}",
        "recorder.free=1",
        *more,
    ]


@contextmanager
def recorder(buses: BusFixture, folder: Path, *more: str) -> Iterator[None]:
    """Record in this process while the context lasts."""
    node = Node("recorder", load(RecorderConfig, Sources(sets=sets(buses, folder, *more))))
    Recorder(node)
    node.bus.open()
    with running(node.loop):
        wait_until(lambda: node.bus.connected, "the recorder's session")
        yield
    node.on_exit()
    node.bus.close()


def recorder_events(buses: BusFixture) -> list[Event]:
    """Return the recorder's events, also earlier ones."""
    found: list[Event] = []
    buses.bus(
        lambda bus: bus.subscribe(
            keys.EVENTS, lambda a: found.append(a.message), depth=64, service="recorder"
        )
    )
    return found


def read(folder: Path) -> list[Entry]:
    """Return the messages of all files, in order."""
    found: list[Entry] = []
    for path in sorted(folder.glob("*.mcap")):
        if not path.stat().st_size:
            continue  # just created
        with Reader(path) as reader:
            found += reader
    return found


def is_whole(path: Path) -> bool:
    with Reader(path) as reader:
        found = list(reader)
    return bool(found) and not reader.cut


def paths(found: list[Entry]) -> set[str]:
    return {each.key.split("/", 3)[3] for each in found}


def test_every_key_is_recorded_with_raw_frames(buses: BusFixture, tmp_path: Path) -> None:
    stranger = buses.session()
    root = f"t2/v1/{buses.robot}"
    with recorder(buses, tmp_path, "recorder.everything=true"):
        until_received(
            lambda: stranger.put(f"{root}/@cmd/first", b""),
            lambda: "@cmd/first" in paths(read(tmp_path)),
            "the subscriptions",
        )
        stranger.put(f"{root}/estop", b"")
        stranger.put(f"{root}/@cmd/motion", b"\x80", encoding="x/y")
        stranger.put(f"{root}/tel/bridge/velocity", b"\x80", attachment=b"frame")
        stranger.put(f"{root}/tel/safety/state", b"\x80", encoding=codec.encoding(m.SafetyState))
        stranger.delete(f"{root}/tel/mine/gone")
        stranger.put("t2/v1/another/tel/x", b"")
        until_received(
            lambda: stranger.put(f"{root}/tel/mine/last", b""),
            lambda: "tel/mine/last" in paths(read(tmp_path)),
            "all of it in a file that is still being written",
        )
    found = {each.key: each.sample for each in read(tmp_path)}
    assert f"{root}/estop" in found
    assert found[f"{root}/@cmd/motion"].encoding == "x/y"
    assert found[f"{root}/tel/bridge/velocity"].raw == b"frame"
    assert found[f"{root}/tel/mine/gone"].deleted
    assert found[f"{root}/tel/safety/state"].payload == b"\x80"  # invalid, and ignored
    assert "t2/v1/another/tel/x" not in found


def test_a_latch_writes_the_black_box_and_old_recordings_make_room(
    buses: BusFixture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tmp_path /= "my recordings"
    tmp_path.mkdir()
    old = [f"{buses.robot}-20260101-00000{n}.mcap" for n in range(2)]
    for name in old:
        (tmp_path / name).write_bytes(bytes(MB))

    def usage(folder: Path) -> SimpleNamespace:
        used = sum(each.stat().st_size for each in folder.iterdir())
        return SimpleNamespace(free=13.5 * MB - used)

    monkeypatch.setattr(shutil, "disk_usage", usage)
    events, numbers = recorder_events(buses), count()
    latched: list[str] = []
    pretend(buses, "bridge", {keys.VELOCITY: lambda: samples.velocity(next(numbers))})
    pretend(buses, "safety", {keys.SAFETY: lambda: samples.state(*latched)})
    with recorder(buses, tmp_path, "recorder.free=12"):
        received: list[m.Velocity] = []
        buses.bus(lambda bus: bus.subscribe(keys.VELOCITY, lambda a: received.append(a.message)))
        wait_until(lambda: len(received) > 50, "some history")
        assert [path.name for path in tmp_path.glob("*.mcap")] == old[1:]
        latched.append("contact")
        wait_until(lambda: "black_box" in [each.name for each in events], "the black box")
    (path,) = tmp_path.glob("*-latch-contact.mcap")
    (event,) = (each for each in events if each.name == "black_box")
    assert event.text == f"The black box is written to '{path}'"
    with Reader(path) as reader:
        found = list(reader)
    states = [each.message.latched for each in found if isinstance(each.message, m.SafetyState)]
    velocities = [each.message.linear for each in found if isinstance(each.message, m.Velocity)]
    assert states[0] == ()
    assert states[-1] == ("contact",)
    assert len(velocities) > 50
    assert velocities == sorted(velocities)
    (removed,) = (each for each in events if each.name == "recordings_removed")
    assert removed.about | {"count": 1, "megabytes": 1.0} == {
        "count": 1,
        "megabytes": 1.0,
        "first": old[0],
    }


def test_without_room_nothing_is_written(buses: BusFixture, tmp_path: Path) -> None:
    events = recorder_events(buses)
    latched: list[str] = []
    pretend(buses, "safety", {keys.SAFETY: lambda: samples.state(*latched)})
    all_of_it = "recorder.free=1000000"  # a terabyte
    with recorder(buses, tmp_path, all_of_it, "recorder.everything=true"):
        wait_until(lambda: "disk_full" in [each.name for each in events], "the first event")
        received: list[m.SafetyState] = []
        buses.bus(lambda bus: bus.subscribe(keys.SAFETY, lambda a: received.append(a.message)))
        wait_until(lambda: len(received) > 10, "safety's word")
        latched.append("estop")
        wait_until(lambda: "black_box_lost" in [each.name for each in events], "the second event")
    assert list(tmp_path.glob("*.mcap")) == []
    (full,) = (each for each in events if each.name == "disk_full")
    assert full.level == "error"
    assert "recorder.free is 1000000" in full.text


def test_the_shift_log_is_answered_and_survives_a_restart(
    buses: BusFixture, tool: Tool, tmp_path: Path
) -> None:
    latched: list[str] = []
    safety = pretend(buses, "safety", {keys.SAFETY: lambda: samples.state(*latched)})
    page = buses.bus(lambda bus: None)
    of_safety = safety.publisher(keys.EVENTS, service="safety")
    of_page = page.publisher(keys.EVENTS, service="dashboard")

    def event(name: m.EventName, phrase: m.Phrase, **about: m.Field) -> m.Event:
        return Event(name=name, level="error", text="", phrases=(phrase,), about=about)

    def texts() -> list[str]:
        return [row["text"] for row in tool("log").lines if row["kind"] != "gap"]

    log = tmp_path / f"{buses.robot}-log.jsonl"
    with recorder(buses, tmp_path):
        wait_until(log.exists, "the first mark")
        of_page.put(event("estop", m.Phrase("event.estop", {"by": "Ann"}), by="Ann"))
        of_safety.put(event("estop", m.Phrase("estop"), cause="estop"))
        latched.append("estop")
        wait_until(lambda: texts() == ["Emergency stop by Ann. No reset is recorded."], "the stop")
        box = f"{buses.robot}-*-latch-estop.mcap"
        wait_until(lambda: tool("log").lines[-1]["recording"], "the name of the black box")
        (file,) = tmp_path.glob(box)
        assert tool("log").lines[-1]["recording"] == file.name
    size = log.stat().st_size
    with recorder(buses, tmp_path):
        wait_until(lambda: log.stat().st_size > size, "a mark after the restart")
        of_page.put(event("reset_request", m.Phrase("event.reset_request", {"by": "Bob"})))
        of_safety.put(event("reset", m.Phrase("reset.done")))
        wait_until(lambda: texts() == ["Emergency stop by Ann. Reset by Bob."], "the reset")
        (gap, stop) = tool("log").lines
        assert (gap["kind"], stop["by"], stop["reset_by"]) == ("gap", "Ann", "Bob")
        assert gap["end_ns"] < stop["t_ns"] < stop["end_ns"]
        shown = tool("log", text=True).out
    offline = tool("log", str(tmp_path), "--days", "1", text=True).out
    assert shown.splitlines()[-1] == offline.splitlines()[-1]


def test_the_shift_log_has_events_from_before_the_recorder_was_on_the_bus(
    buses: BusFixture, tool: Tool, tmp_path: Path
) -> None:
    """After a cut, too: who pressed the emergency stop then is in such an event."""
    page = buses.bus(lambda bus: None)
    phrase = m.Phrase("event.estop", {"by": "Ann"})
    page.publisher(keys.EVENTS, service="dashboard").put(
        Event(name="estop", level="error", text="", phrases=(phrase,), about={"by": "Ann"})
    )
    with recorder(buses, tmp_path):
        wait_until(lambda: "Ann" in str(tool("log").lines), "the earlier event")


def test_t2_log_without_a_recorder_names_it(buses: BusFixture, tool: Tool) -> None:
    result = tool("log")
    assert result.code == 1
    assert "recorder" in result.err


def test_sigkill_loses_at_most_a_second(buses: BusFixture, tmp_path: Path) -> None:
    numbers = count(1)
    put: list[m.Velocity] = []

    def velocity() -> m.Velocity:
        put.append(samples.velocity(next(numbers)))
        return put[-1]

    pretend(buses, "bridge", {keys.VELOCITY: velocity})
    words = [
        w for each in sets(buses, tmp_path, "recorder.everything=true") for w in ("--set", each)
    ]
    with subprocess.Popen(
        [sys.executable, "-m", "services.recorder", *words], stderr=subprocess.DEVNULL
    ) as process:
        stalls = StallRecorder()
        try:
            wait_until(lambda: len(read(tmp_path)) > 60, "some seconds of recording")
        finally:
            killed_ns = time.time_ns()
            process.kill()
            stall_s = stalls.stop()
    (path,) = tmp_path.glob("*.mcap")
    with Reader(path) as reader:
        found = list(reader)
    assert reader.cut
    assert len(found) > 60
    numbers_read = [each.message.linear for each in found if isinstance(each.message, m.Velocity)]
    assert numbers_read == list(range(int(numbers_read[0]), int(numbers_read[-1]) + 1))
    assert (killed_ns - found[-1].log_ns) / NS_PER_S < 1.0 + 2 * stall_s


def test_a_disk_error_ends_the_file_and_nothing_else(
    buses: BusFixture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    events, numbers = recorder_events(buses), count()
    pretend(buses, "bridge", {keys.VELOCITY: lambda: samples.velocity(next(numbers))})

    def refuse(_: RecordingWriter) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with recorder(buses, tmp_path, "recorder.everything=true"):
        wait_until(lambda: read(tmp_path), "a recording")
        monkeypatch.setattr(RecordingWriter, "flush", refuse)
        wait_until(lambda: "disk_full" in [each.name for each in events], "the event")
        monkeypatch.undo()
        (path,) = tmp_path.glob("*.mcap")
        wait_until(lambda: is_whole(path), "the end of the file")
    assert list(tmp_path.glob("*.mcap")) == [path]
    (full,) = (each for each in events if each.name == "disk_full")
    assert "No space left on device" in full.text


def test_t2_record_completes_its_files_on_ctrl_c(buses: BusFixture, tmp_path: Path) -> None:
    numbers = count()
    pretend(buses, "bridge", {keys.VELOCITY: lambda: samples.velocity(next(numbers))})
    where = ["--set", f"bus.connect={buses.endpoint}", "--set", "recorder.free=1"]
    words = ["record", "--folder", str(tmp_path), "--robot", buses.robot, *where]
    with subprocess.Popen(
        [sys.executable, "-m", "cli", *words], stderr=subprocess.DEVNULL
    ) as process:
        try:
            wait_until(lambda: read(tmp_path), "a recording")
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE_S) == 0
        finally:
            process.kill()
    (path,) = tmp_path.glob("*.mcap")
    with Reader(path) as reader:
        assert [each for each in reader if each.kind == "Velocity"]
    assert not reader.cut
