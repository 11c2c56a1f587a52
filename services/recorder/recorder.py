"""The recorder on the bus: hears every key, says nothing that moves, and stops before the disk."""

import time
from collections.abc import Callable
from pathlib import Path

from common import codec, keys
from common.errors import MessageError
from common.messages import SafetyState
from common.sample import Sample
from common.service import Node
from common.version import VERSION
from services.recorder.blackbox import BlackBox
from services.recorder.config import MB, RecorderConfig
from services.recorder.latches import Latches
from services.recorder.mcap_codec import Translator
from services.recorder.retention import Stored
from services.recorder.rolling_writer import Tape
from services.recorder.storage import Shelf
from services.recorder.writer import Recording

# `**` passes by what begins with "@", on purpose: both are needed for all.
EVERYTHING = ("**", "@cmd/**")
DEPTH = 10_000  # samples that may wait while the disk is slow: some 20 s of a whole stack
SLICE_S, FLUSH_S, LOOK_S = 0.05, 0.5, 1.0


class Recorder:
    """The shell around the tape and the black box."""

    def __init__(self, node: Node[RecorderConfig]) -> None:
        settings = node.config.recorder
        self._node = node
        self._translator = Translator(node.config.vehicle)
        self._latches = Latches()
        self._safety = keys.SAFETY.on(node.bus.robot)
        robot = node.bus.robot if settings.make_room else None
        self._shelf = Shelf(Path(settings.folder), settings.free * MB, robot=robot)
        self._tape = Tape(settings, self._begin, self._end) if settings.everything else None
        self._box = BlackBox(settings, self._begin, self._end)
        node.counters.update(recorded=0, not_recorded=0, removed=0)
        self._look(time.monotonic_ns())
        for each in EVERYTHING:
            node.bus.tap(f"{keys.ROOT}/{node.bus.robot}/{each}", self._on_sample, depth=DEPTH)
        node.loop.every(SLICE_S, lambda now_ns: self._safely(lambda: self._box.write(now_ns)))
        node.loop.every(FLUSH_S, self._flush)
        node.loop.every(LOOK_S, self._look)
        node.on_exit = self._close

    def _on_sample(self, sample: Sample) -> None:
        self._box.keep(sample)
        if self._tape is not None:
            self._safely(lambda: self._to_tape(sample))
        if sample.key == self._safety:
            self._on_safety(sample)

    def _to_tape(self, sample: Sample) -> None:
        if self._tape is None or not self._shelf.has_room:
            self._node.counters["not_recorded"] += 1
            return
        self._tape.write(sample)
        self._node.counters["recorded"] += 1

    def _on_safety(self, sample: Sample) -> None:
        try:
            state = codec.decode(sample.payload, SafetyState)
        except MessageError:
            return  # it is recorded as it came
        names = self._latches.take(state)
        if names and self._shelf.has_room:
            self._box.latched(names, sample.received_ns)
        elif names:
            text = f"{', '.join(names)} latched, and the black box is not written"
            self._node.event("black_box_lost", "error", f"{text}: {self._shelf.trouble}")

    def _flush(self, now_ns: int) -> None:
        self._safely(self._box.flush)
        if self._tape is not None:
            tape = self._tape
            self._safely(lambda: tape.flush(now_ns))

    def _look(self, now_ns: int) -> None:
        """Make room, stop before the disk is full, continue when there is room again."""
        had_room = self._shelf.has_room
        removed = self._shelf.look(now_ns)
        if removed:
            self._report_removed(removed)
        if had_room and not self._shelf.has_room:
            self._stop()
        elif not had_room and self._shelf.has_room:
            self._node.event("disk_room", "info", "there is room again: recording goes on")

    def _report_removed(self, removed: list[Stored]) -> None:
        self._node.counters["removed"] += len(removed)
        freed = sum(each.size for each in removed) / MB
        text = f"{len(removed)} of the oldest recordings removed for {freed:.0f} MB of room"
        self._node.event("recordings_removed", "warning", text, first=removed[0].name)

    def _stop(self) -> None:
        text = f"no room for recordings: {self._shelf.trouble}"
        self._node.event("disk_full", "error", text, folder=str(self._shelf.folder))
        for close in (self._box.drop, self._tape.close if self._tape else None):
            try:
                if close is not None:
                    close()
            except OSError as error:
                self._node.log.error("a recording has no end", reason=str(error))

    def _safely(self, work: Callable[[], None]) -> None:
        """Do what the disk may refuse."""
        try:
            work()
        except OSError as error:
            self._shelf.refused(error, time.monotonic_ns())
            self._stop()

    def _begin(self, first: Sample, why: str) -> Recording:
        path = self._shelf.path(self._node.bus.robot, first.wall_ns, why)
        about = {
            "robot": self._node.bus.robot,
            "version": VERSION,
            "why": why or "everything",
        }
        recording = Recording(path, self._translator, about)
        self._node.log.info("recording", file=str(path))
        return recording

    def _end(self, recording: Recording) -> None:
        recording.close()
        path, messages = str(recording.path), recording.messages
        if "-latch-" in recording.path.name:
            text = f"the black box is written: {path}"
            self._node.event("black_box", "info", text, file=path, messages=messages)
        else:
            self._node.log.info("recorded", file=path, messages=messages)

    def _close(self) -> None:
        self._safely(self._box.close)
        if self._tape is not None:
            self._safely(self._tape.close)
