"""The recorder's shell: subscribes to every key, writes files, stops before the disk is full."""

import shlex
from collections.abc import Callable
from pathlib import Path

from common import clock
from common.service import Node
from services.recorder.blackbox import BlackBox
from services.recorder.config import RecorderConfig
from services.recorder.mcap_codec import Encoder
from services.recorder.storage import MB, Storage, StoredFile
from services.recorder.writer import RecordingWriter, RollingWriter
from t2 import codec, keys
from t2.codec import Sample
from t2.errors import MessageError
from t2.messages import Phrase, SafetyState

# `**` does not match chunks that begin with "@": two expressions cover all keys.
EVERYTHING = ("**", "@cmd/**")
# Samples that may wait for a slow disk: about 20 s of a whole stack. Their bytes are bounded by the
# unit's MemoryMax alone.
DEPTH = 10_000
SLICE_S, FLUSH_S, CHECK_S = 0.05, 0.5, 1.0


class Recorder:
    """Connects bus, rolling writer, black box and storage."""

    def __init__(self, node: Node[RecorderConfig]) -> None:
        settings = node.config.recorder
        self._node = node
        self._encoder = Encoder(node.config.vehicle)
        self._safety_key = keys.SAFETY.on(node.bus.robot)
        robot = node.bus.robot if settings.make_room else None
        self._storage = Storage(Path(settings.folder), settings.free * MB, robot=robot)
        files = (self._open_recording, self._close_recording)
        self._everything = settings.everything
        self._rolling = RollingWriter(*files)
        self._black_box = BlackBox(*files)
        node.counters.update(recorded=0, not_recorded=0, removed=0)
        self._check_storage(clock.now_ns())
        for each in EVERYTHING:
            node.bus.tap(f"{keys.ROOT}/{node.bus.robot}/{each}", self._on_sample, depth=DEPTH)
        node.loop.every(
            SLICE_S, lambda now_ns: self._on_disk(lambda: self._black_box.write(now_ns))
        )
        node.loop.every(FLUSH_S, self._flush)
        node.loop.every(CHECK_S, self._check_storage)
        node.on_exit = self._close

    def _on_sample(self, sample: Sample) -> None:
        self._black_box.add(sample)
        if self._everything:
            self._on_disk(lambda: self._record(sample))
        if sample.key == self._safety_key:
            self._on_safety(sample)

    def _record(self, sample: Sample) -> None:
        if not self._storage.has_room:
            self._node.counters["not_recorded"] += 1
            return
        self._rolling.write(sample)
        self._node.counters["recorded"] += 1

    def _on_safety(self, sample: Sample) -> None:
        try:
            state = codec.decode(sample.payload, SafetyState)
        except MessageError:
            return  # it is recorded unchanged
        causes = self._black_box.new_causes(state)
        if causes and self._storage.has_room:
            self._black_box.trigger(causes, sample.received_ns)
        elif causes:
            problem = self._storage.problem
            self._node.event("black_box_lost", "error", causes=tuple(causes), problem=problem)

    def _flush(self, now_ns: int) -> None:
        self._on_disk(self._black_box.flush)
        self._on_disk(lambda: self._rolling.flush(now_ns))

    def _check_storage(self, now_ns: int) -> None:
        """Make room, stop before the disk is full, continue when there is room again."""
        had_room = self._storage.has_room
        removed = self._storage.check(now_ns)
        if removed:
            self._report_removed(removed)
        if had_room and not self._storage.has_room:
            self._stop()
        elif not had_room and self._storage.has_room:
            self._node.event("disk_room", "info")

    def _report_removed(self, removed: list[StoredFile]) -> None:
        self._node.counters["removed"] += len(removed)
        megabytes = sum(each.size for each in removed) / MB
        count, first = len(removed), removed[0].name
        self._node.event(
            "recordings_removed", "warning", count=count, megabytes=megabytes, first=first
        )

    def _stop(self) -> None:
        folder, problem = str(self._storage.folder), self._storage.problem
        self._node.event("disk_full", "error", folder=folder, problem=problem)
        for close in (self._black_box.finish, self._rolling.close):
            try:
                close()
            except OSError as error:
                self._node.log.error("cannot complete a recording", reason=str(error))

    def _on_disk(self, write: Callable[[], None]) -> None:
        """Call what writes to the disk; stop recording after an error."""
        try:
            write()
        except OSError as error:
            self._storage.on_error(error, clock.now_ns())
            self._stop()

    def _open_recording(self, first: Sample, reason: str) -> RecordingWriter:
        path = self._storage.new_path(self._node.bus.robot, first.wall_ns, reason)
        recording = RecordingWriter(path, self._encoder)
        self._node.log.info("recording", file=str(path))
        return recording

    def _close_recording(self, recording: RecordingWriter) -> None:
        recording.close()
        path, messages = str(recording.path), recording.messages
        if "-latch-" in recording.path.name:
            # From any folder it can be pasted after `t2 report`.
            quoted = shlex.quote(str(recording.path.absolute()))
            phrase = Phrase("event.black_box", {"file": quoted})
            self._node.event("black_box", "info", phrase, file=path, messages=messages)
        else:
            self._node.log.info("recorded", file=path, messages=messages)

    def _close(self) -> None:
        self._on_disk(self._black_box.close)
        self._on_disk(self._rolling.close)
