"""The recorder's shell: subscribes to every key, writes files, stops before the disk is full."""

import shlex
import time
from collections.abc import Callable
from pathlib import Path

from common import clock
from common.bus.bus import Arrival, Caller
from common.freshness import NS_PER_S
from common.service import Node
from services.recorder import shift
from services.recorder.blackbox import BlackBox, PictureThinning
from services.recorder.config import RecorderConfig
from services.recorder.mcap_codec import Encoder
from services.recorder.shift_log import ShiftLog, file_of
from services.recorder.storage import MB, Storage, StoredFile
from services.recorder.writer import RecordingWriter, RollingWriter
from t2 import codec, keys
from t2.codec import Sample
from t2.errors import MessageError
from t2.messages import Event, LogReply, LogRequest, Phrase, SafetyState

# `**` does not match chunks that begin with "@": two expressions cover all keys.
EVERYTHING = ("**", "@cmd/**")
# Samples that may wait for a slow disk: about 20 s of a whole stack. Their bytes are bounded by the
# unit's MemoryMax alone.
DEPTH = 10_000
SLICE_S, FLUSH_S, CHECK_S = 0.05, 0.5, 1.0
LOG_S, LOG_RETRY_S = 1.0, 10  # of the shift log: between two writes, and after an error


class Recorder:
    """Connects bus, rolling writer, black box, shift log and storage."""

    def __init__(self, node: Node[RecorderConfig], *, keeps_log: bool = True) -> None:
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
        self._thinning = PictureThinning()
        robot = node.bus.robot
        self._log_file = file_of(self._storage.folder, robot)
        self._log = ShiftLog(self._log_file, robot, node.bus.host)
        self._log_due_ns, self._keeps_log = 0, keeps_log
        node.counters.update(recorded=0, not_recorded=0, removed=0, log_unwritten=0)
        self._check_storage(clock.now_ns())
        for each in EVERYTHING:
            node.bus.tap(f"{keys.ROOT}/{node.bus.robot}/{each}", self._on_sample, depth=DEPTH)
        node.loop.every(
            SLICE_S, lambda now_ns: self._on_disk(lambda: self._black_box.write(now_ns))
        )
        node.loop.every(FLUSH_S, self._flush)
        node.loop.every(CHECK_S, self._check_storage)
        if keeps_log:
            # With their history: a name may be in an event of somebody who was cut off.
            node.bus.subscribe(keys.EVENTS, self._on_event, depth=keys.EVENTS_DEPTH, service="*")
            node.bus.serve(keys.LOG, self._on_log)
            node.loop.every(LOG_S, self._write_log)
            node.loop.every(60.0, self._report_dropped)
        node.on_exit = self._close

    def _on_sample(self, sample: Sample) -> None:
        if not self._thinning.keeps(sample):
            return
        self._black_box.add(sample)
        if self._everything:
            self._on_disk(lambda: self._record(sample))
        if sample.key == self._safety_key:
            self._on_safety(sample)

    def _on_event(self, arrival: Arrival[Event]) -> None:
        service = arrival.key.rpartition("/")[2]
        wall_ns = time.time_ns() - (clock.now_ns() - arrival.received_ns)
        self._log.note(service, arrival.message, arrival.received_ns, wall_ns)

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
        if self._keeps_log:
            self._log.update(sample.received_ns, sample.wall_ns)
        causes = self._black_box.new_causes(state)
        for cause in causes if self._keeps_log else ():
            event = shift.latch(state, cause)
            self._log.note("safety", event, sample.received_ns, sample.wall_ns)
        if causes and self._storage.has_room:
            self._black_box.trigger(causes, sample.received_ns)
        elif causes:
            problem = self._storage.problem
            self._node.event("black_box_lost", "error", causes=tuple(causes), problem=problem)

    # --- the shift log ----------------------------------------------------------------------

    def _on_log(self, request: LogRequest, caller: Caller[LogReply]) -> None:
        """Answer with the newest rows; the file is small, see ``shift_log.SIZE_MAX``."""
        try:
            caller.reply(self._log.reply(request, clock.now_ns(), time.time_ns()))
        except OSError as error:
            reason = error.strerror or str(error)
            caller.refuse(Phrase("log.unreadable", {"file": str(self._log_file), "reason": reason}))

    def _write_log(self, now_ns: int) -> None:
        if now_ns < self._log_due_ns:
            return
        try:
            self._log.write()
        except OSError as error:
            self._log_due_ns = now_ns + LOG_RETRY_S * NS_PER_S
            self._node.counters["log_unwritten"] += 1
            self._node.log.error("cannot write the shift log", reason=str(error))

    def _report_dropped(self, _: int) -> None:
        if count := self._log.take_dropped():
            self._node.event("log_dropped", "warning", count=count)

    # --- files ------------------------------------------------------------------------------

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
        if self._keeps_log:
            self._log.mark()
            self._write_log(self._log_due_ns)


def without_log(node: Node[RecorderConfig]) -> Recorder:
    """Return a recorder beside the robot's own one, which keeps the shift log."""
    return Recorder(node, keeps_log=False)
