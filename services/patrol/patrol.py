"""Patrol on the bus: safety's state and poses in the map in, requests of its source out."""

import contextlib
import os
import time
from datetime import UTC, datetime, tzinfo
from pathlib import Path
from zoneinfo import ZoneInfo

from msgspec.structs import replace

from common import clock
from common.bus.bus import Arrival, Caller
from common.freshness import NS_PER_S
from common.heartbeat import Echoes
from common.service import Node
from common.source import DriveSource
from services.patrol.config import PatrolConfig
from services.patrol.core.course import SOURCE, TICK_S, Note
from services.patrol.core.patrol import STOPPING, Patrol
from services.patrol.core.routes import problem
from services.patrol.core.teaching import Refused
from services.patrol.schedule import Due, Schedule
from services.patrol.store import Store
from t2 import keys
from t2 import messages as m
from t2.messages import Phrase
from t2.words import done

QUEUED = 16  # poses, until the loop wakes up: each counts while a route is taught
ECHOES = 64  # queued safety states; a call that echoes a dropped one is refused
PERIOD_S = 1 / keys.PATROL.rate_hz
WRITTEN_M = 1.0  # of progress, between two notes of the open round
TAUGHT_S = 5.0  # between two notes of the route that is being taught
RETRY_S = 10.0  # after a failure of the disk
LAMP_OFF = 0  # mode
LOCALTIME = Path("/etc/localtime")


class PatrolService:
    """Connects patrol to the bus, to its folder and to the wall clock."""

    def __init__(self, node: Node[PatrolConfig]) -> None:
        self._node = node
        settings = node.config.patrol
        self._patrol = Patrol(node.config.robot.id, settings.announce, settings.patience)
        self._store = Store(Path(settings.folder))
        self._schedule = Schedule(settings.schedule, zone(settings.timezone), _now())
        self._echoes = Echoes()
        self._sent: tuple[object, ...] = ()  # what changed of the state last: published at once
        self._published_ns = 0
        self._written: tuple[str, float] = ("", 0.0)  # state and place of the noted round
        self._taught = ("", 0)  # name and points of the noted route
        self._is_lit: bool | None = None  # not known: an earlier start may have lit it
        bus = node.bus
        self._source = DriveSource(bus, SOURCE)
        self._to_state = bus.publisher(keys.PATROL)
        bus.subscribe(keys.MAP_POSE, self._on_pose, depth=QUEUED)
        bus.subscribe(keys.SAFETY, self._on_safety, depth=ECHOES)
        bus.subscribe(keys.PATROL, self._on_patrol, refused=self._on_other)
        bus.subscribe(keys.EVENTS, self._on_recorder, depth=QUEUED, service="recorder")
        bus.serve(keys.TEACH, self._on_teach)
        bus.serve(keys.ROUTES, self._on_routes)
        bus.serve(keys.ROUND, self._on_round)
        bus.serve(keys.ROUNDS, self._on_rounds)
        node.loop.every(TICK_S, self._tick)
        node.loop.every(1.0, self._check_schedule)
        node.loop.every(RETRY_S, self._write_waiting)
        node.loop.every(TAUGHT_S, self._write_teaching)
        node.on_exit = self._leave
        self._restore()

    # --- messages ---------------------------------------------------------------------------

    def _on_pose(self, arrival: Arrival[m.MapPose]) -> None:
        self._patrol.on_pose(arrival.message, arrival.received_ns)

    def _on_safety(self, arrival: Arrival[m.SafetyState]) -> None:
        self._echoes = self._echoes.received(arrival.message, arrival.received_ns)
        self._patrol.on_safety(arrival.message, arrival.received_ns)

    def _on_patrol(self, arrival: Arrival[m.PatrolState]) -> None:
        if arrival.message.boot != self._node.bus.boot:
            self._patrol.on_other(arrival.received_ns)

    def _on_other(self, *_: object) -> None:
        """Note a state of another version: ours can be decoded."""
        self._patrol.on_other(clock.now_ns())

    def _on_recorder(self, arrival: Arrival[m.Event]) -> None:
        """Note the black box of a latch during a round."""
        event, course = arrival.message, self._patrol.course
        if event.name == "black_box" and course is not None and self._patrol.is_open:
            course.diary.file(Path(str(event.about.get("file", ""))).name)

    def _tick(self, now_ns: int) -> None:
        request = self._patrol.tick(now_ns, time.time_ns())
        if request is not None:
            self._source.put(request)
        self._after(now_ns)

    def _after(self, now_ns: int) -> None:
        """Publish and write what has changed."""
        for note in self._patrol.notes:
            self._event(note)
        self._patrol.notes = []
        message = self._patrol.message(now_ns)
        self._write(message)
        self._light(message)
        teaching = message.teaching
        changed = message.round, message.text, teaching and (teaching.stations, teaching.text)
        if changed != self._sent or now_ns - self._published_ns >= PERIOD_S * NS_PER_S:
            self._sent, self._published_ns = changed, now_ns
            self._to_state.put(self._with_next(message))

    def _with_next(self, message: m.PatrolState) -> m.PatrolState:
        if (found := self._schedule.next) is None:
            return message
        name, route, at = found
        t_ns = round(at.timestamp() * NS_PER_S)
        return replace(message, next=m.NextRound(schedule=name, route=route, t_ns=t_ns))

    def _event(self, note: Note) -> None:
        self._node.event(note.name, note.level, *note.phrases)

    def _light(self, message: m.PatrolState) -> None:
        """Light the lamp while a round is announced or driven."""
        settings = self._node.config.patrol
        lit = message.state in {"announcing", "driving", "staying", "waiting", "returning"}
        if settings.lamp_channel and lit != self._is_lit:
            self._is_lit = lit
            mode = settings.lamp_mode if lit else LAMP_OFF
            request = m.LedRequest(channel=settings.lamp_channel, mode=mode)
            self._node.bus.call(keys.SET_LED, request, lambda _: None, self._no_lamp)

    def _no_lamp(self, refusal: m.Refusal) -> None:
        self._node.log.warning(f"the lamp is not set: {refusal.text}")

    # --- calls ------------------------------------------------------------------------------

    def _on_teach(self, request: m.TeachRequest, caller: Caller[m.Done]) -> None:
        now_ns = clock.now_ns()
        if late := self._echoes.refusal(request.echo, now_ns):
            caller.refuse(*late)
            return
        try:
            phrases = self._teach(request)
        except Refused as refused:
            caller.refuse(refused.reason)
        except OSError as error:
            caller.refuse(self._disk(error))
        else:
            caller.reply(done(*phrases, boot=self._node.bus.boot))
        self._after(now_ns)

    def _teach(self, request: m.TeachRequest) -> m.Phrases:
        patrol = self._patrol
        if request.action in {"begin", "delete"} and not request.route:
            raise Refused(Phrase("patrol.no_name"))
        if request.action in {"begin", "station"} and not request.station:
            raise Refused(Phrase("teach.no_station"))
        name = request.route or ""
        if request.action == "begin":
            if self._store.has(name):
                raise Refused(Phrase("teach.exists", {"route": name}))
            return patrol.begin(name, request.station, request.stay, clock.now_ns())
        if request.action == "station":
            return patrol.station(request.station, request.stay, clock.now_ns())
        if request.action == "cancel":
            return patrol.cancel()
        if request.action == "end":
            route = patrol.taught()
            self._store.save_route(route)
            return patrol.end(route)
        return self._change(request)

    def _change(self, request: m.TeachRequest) -> m.Phrases:
        """Save or delete a route."""
        route = request.points
        if request.action == "save" and route is None:
            raise Refused(Phrase("patrol.no_name"))
        name = route.name if route is not None else request.route or ""
        if reason := self._patrol.change_refusal(name):
            raise Refused(reason)
        if request.action == "save" and route is not None:
            if reason := problem(route):
                raise Refused(reason)
            self._store.save_route(route)
            phrase = Phrase("teach.saved", {"route": name})
        else:
            if not self._store.has(name):
                raise Refused(Phrase("route.none", {"route": name}))
            self._store.delete_route(name)
            phrase = Phrase("teach.deleted", {"route": name})
        self._node.event("route_changed", "info", phrase)
        return (phrase,)

    def _on_routes(self, request: m.RoutesRequest, caller: Caller[m.RoutesReply]) -> None:
        try:
            if request.route is None:
                caller.reply(m.RoutesReply(routes=tuple(self._store.routes())))
                return
            found = self._store.route(request.route)
        except OSError as error:
            caller.refuse(self._disk(error))
            return
        if isinstance(found, Phrase):
            caller.refuse(found)
        else:
            caller.reply(m.RoutesReply(route=found))

    def _on_round(self, request: m.RoundRequest, caller: Caller[m.Done]) -> None:
        now_ns = clock.now_ns()
        late = self._echoes.refusal(request.echo, now_ns)
        if late and request.action not in STOPPING:
            caller.refuse(*late)
            return
        if request.action == "start":
            reason = self._start(request.route, "", now_ns)
        else:
            reason = self._patrol.act(request.action, now_ns, time.time_ns())
        if reason is not None:
            caller.refuse(reason)
        else:
            caller.reply(done(*self._patrol.message(now_ns).phrases, boot=self._node.bus.boot))
        self._after(now_ns)

    def _start(self, name: str | None, schedule: str, now_ns: int) -> Phrase | None:
        if not name:
            return Phrase("patrol.no_name")
        try:
            route = self._store.route(name)
            if isinstance(route, Phrase):
                return route
            new_id = self._store.new_id(f"{_now():%Y%m%d-%H%M%S}", name)
            reason = self._patrol.start(route, new_id, schedule, now_ns, time.time_ns())
            if reason is None and self._patrol.course is not None:
                self._store.begin(self._patrol.course.open, route)
        except OSError as error:
            self._patrol.forget()
            return self._disk(error)
        return reason

    def _on_rounds(self, request: m.RoundsRequest, caller: Caller[m.RoundsReply]) -> None:
        try:
            if not request.round:
                caller.reply(m.RoundsReply(rounds=tuple(self._store.rounds(request.most))))
                return
            found, tracked = self._store.round(request.round), self._store.tracked(request.round)
        except OSError as error:
            caller.refuse(self._disk(error))
            return
        if found is None:
            caller.refuse(Phrase("patrol.no_round", {"round": request.round}))
        elif tracked is None:
            caller.reply(m.RoundsReply(rounds=(found,)))
        else:
            caller.reply(m.RoundsReply(rounds=(found,), route=tracked.route, track=tracked.track))

    # --- the schedule -----------------------------------------------------------------------

    def _check_schedule(self, now_ns: int) -> None:
        for due in self._schedule.due(_now(), now_ns / NS_PER_S):
            if reason := self._begin(due, now_ns):
                fields: dict[str, m.Field] = {"schedule": due.schedule, "route": due.route}
                self._node.event(
                    "round_skipped", "warning", Phrase("patrol.skipped", fields), reason
                )

    def _begin(self, due: Due, now_ns: int) -> Phrase | None:
        if due.late_s > self._node.config.patrol.grace:
            return Phrase("patrol.late", {"seconds": min(due.late_s, m.MAX_NUMBER)})
        return self._start(due.route, due.schedule, now_ns)

    # --- the folder -------------------------------------------------------------------------

    def _restore(self) -> None:
        """Take up the round that was not over when the service ended."""
        try:
            if (found := self._store.read_open()) is not None:
                self._patrol.restore(*found, time.time_ns())
            taught = self._store.read_teaching()
            if taught is not None and not self._store.has(taught.route):
                self._patrol.restore_teaching(taught)
                self._taught = taught.route, len(taught.points)
        except OSError as error:
            self._unwritten(error)

    def _write(self, message: m.PatrolState) -> None:
        """Note the round: where it is, or in the ledger that it is over."""
        course = self._patrol.course
        if course is None or message.round == "":
            return
        place = f"{message.round} {message.state} {message.homeward}", message.progress or 0.0
        if self._written[0] == place[0] and abs(self._written[1] - place[1]) < WRITTEN_M:
            return
        self._written = place
        try:
            if self._patrol.is_open:
                self._store.write_open(course.open, sync=False)
            else:
                self._store.end(course.diary.record, course.route, course.diary.track)
        except OSError as error:
            self._unwritten(error)

    def _write_teaching(self, _: int) -> None:
        taught = self._patrol.open_teaching
        noted = ("", 0) if taught is None else (taught.route, len(taught.points))
        if noted != self._taught:
            self._taught = noted
            try:
                self._store.write_teaching(taught)
            except OSError as error:
                self._node.log.warning(str(error))

    def _write_waiting(self, _: int) -> None:
        if self._store.waiting:
            try:
                self._store.write_waiting()
            except OSError as error:
                self._node.counters["unwritten"] += 1
                self._node.log.warning(str(error))

    def _unwritten(self, error: OSError) -> None:
        self._node.counters["unwritten"] += 1
        fields: dict[str, m.Field] = {
            "reason": error.strerror or str(error), "count": len(self._store.waiting)
        }  # fmt: skip
        self._node.event("round_unwritten", "error", Phrase("patrol.unwritten", fields))

    def _disk(self, error: OSError) -> Phrase:
        folder, reason = str(self._store.folder), error.strerror or str(error)
        return Phrase("patrol.disk", {"folder": folder, "reason": reason})

    def _leave(self) -> None:
        """Note where an open round is, so that the next start resumes it."""
        course = self._patrol.course
        self._write_teaching(0)
        self._write_waiting(0)
        if course is not None and self._patrol.is_open:
            try:
                self._store.write_open(course.open, sync=True)
            except OSError as error:
                self._node.log.warning(str(error))


def zone(name: str) -> tzinfo:
    """Return the time zone of the schedule; empty: that of the computer."""
    if name:
        return ZoneInfo(name)
    if name := os.environ.get("TZ", "").lstrip(":"):
        with contextlib.suppress(OSError, ValueError, KeyError):  # a path, or a rule as CET-1CEST
            return ZoneInfo(name)
    try:
        with LOCALTIME.open("rb") as file:
            return ZoneInfo.from_file(file)
    except (OSError, ValueError):
        return UTC


def _now() -> datetime:
    return datetime.now(UTC)
