"""One robot on the bus: its telemetry, its driver's requests and calls; in the node's loop.

Each robot has a bus session of its own, which opens with the first viewer of its page.
"""

from collections.abc import Callable
from typing import Any

from common import clock
from common.bus.bus import Arrival, Bus
from common.bus.session import common_name, is_viewer
from common.freshness import NS_PER_S
from common.log import Logger
from common.source import DriveSource, KeepalivePublisher
from services.dashboard import client_messages as client
from services.dashboard.config import DashboardConfig
from services.dashboard.driver_lock import DriverLock, HoldState, PageKeepalive, Push
from services.dashboard.i18n import Texts, label, phrase, rendered
from services.dashboard.patrol import Routes
from services.dashboard.snapshot import DriverState
from services.dashboard.telemetry_cache import TelemetryCache, path_of
from t2 import keys
from t2 import messages as m
from t2.client import (
    Contest,
    DriveRequests,
    EstopRepetition,
    EstopStep,
    Phase,
    ResetCheck,
    request,
    reset_request,
)
from t2.keys import Topic
from t2.words import render

Notify = Callable[[m.Level, Texts], None]

FIXED_TOPICS: tuple[Topic[Any], ...] = (
    keys.VELOCITY, keys.ULTRASONIC, keys.BUMPER, keys.LINK, keys.SWITCHES,
    keys.ODOMETRY, keys.MAP_POSE, keys.SAFETY, keys.MOTION, keys.PATROL,
)  # fmt: skip
WILDCARD_DEPTH = 16  # of a key with many publishers
# How long an emergency stop is repeated without a confirmation, as on the page: the link to the
# robot may be cut.
ESTOP_KEPT_S = 30.0


class Robot:
    """The state of a robot and the requests to it; ``tick`` runs 20 times a second."""

    def __init__(self, bus: Bus, config: DashboardConfig, broadcast: Notify) -> None:
        settings = config.dashboard
        self.bus = bus
        self.telemetry = TelemetryCache()
        self.driver_lock = DriverLock()
        self.routes = Routes(bus)
        self.may_stop = not is_viewer(bus.where)
        self._gears = config.vehicle.gears_linear, config.vehicle.gears_angular
        self._broadcast = broadcast  # to all viewers of this robot
        self._requests = DriveRequests()
        self._source = DriveSource(bus, settings.source, self._on_denied)
        self._contest = Contest(settings.source)
        self._overruled = False  # our driver's hold has ended by that
        self._estop = EstopRepetition()
        self.keepalive = PageKeepalive(settings.estop_keepalive)
        self._keepalives: KeepalivePublisher | None = None
        if settings.estop_keepalive:
            self._keepalives = KeepalivePublisher(bus, settings.estop_keepalive)
        self._requests_path = path_of(keys.DRIVE.on(bus.robot, source=settings.source))
        self._estop_until_ns = 0
        self._stopped_by = ""  # who requested the last emergency stop
        self._resets: list[tuple[ResetCheck, m.ResetDone, Notify]] = []  # with the answer
        self._log = Logger(robot=bus.robot)
        self._events = bus.publisher(keys.EVENTS, service="dashboard")
        for topic in FIXED_TOPICS:
            bus.subscribe(topic, self._on_message)
        for side in ("left", "right"):
            bus.subscribe(keys.DRIVER, self._on_message, side=side)
        bus.subscribe(keys.DRIVE, self._on_message, depth=WILDCARD_DEPTH, source="*")
        bus.subscribe(keys.HEALTH, self._on_message, depth=WILDCARD_DEPTH, service="*")
        bus.subscribe(keys.EVENTS, self._on_event, depth=keys.EVENTS_DEPTH, service="*")
        bus.watch_live(keys.live_key(bus.robot, "*", "*"), self.telemetry.update_liveliness)

    # --- the loop -----------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """Send the requests of this tick and repeat what is not confirmed."""
        safety = self.telemetry.newest(keys.SAFETY, now_ns)
        self._repeat_estop(safety, now_ns)
        self._yield(safety)
        push = self.driver_lock.held(now_ns)
        drive = self._requests.tick(self._requested(push) if push else None)
        if drive is not None:
            # A held control is as old as what its operator was shown; our own zeros are new.
            shown = self.driver_lock.shown if push else None
            sent = self._source.put(drive, shown.value.heartbeat if shown else None)
            self.telemetry.update(self._requests_path, sent, now_ns)
        self._check_resets(safety, now_ns)

    @property
    def may_drive(self) -> bool:
        """Whether the router passes our requests on, as far as is known."""
        return self.may_stop and not self._source.denied

    def driver_state(self) -> DriverState:
        """Return the viewer with the driver lock and the state of its hold."""
        lock = self.driver_lock
        return DriverState(
            id=lock.driver,
            name=lock.name,
            hold=lock.state,
            gear=lock.gear,
            in_sight=lock.in_sight,
            other=self._contest.other,
            overruled=self._overruled,
            may=self.may_drive,
            may_stop=self.may_stop,
        )

    @property
    def silent(self) -> bool:
        """Whether no request is being sent."""
        return self._requests.phase is Phase.SILENT

    def free_driver(self) -> None:
        """End the driver's hold, with zeros, and free the driver lock."""
        if self.driver_lock.driver is not None:
            self.driver_lock.leave(self.driver_lock.driver)

    def event(self, name: m.EventName, level: m.Level, **about: m.Field) -> None:
        """Publish and log what a viewer did, with the certificate of this dashboard."""
        by = common_name(self.bus.where)
        phrases = (
            m.Phrase(f"event.{name}", about),
            *((m.Phrase("operator.by", {"by": by}),) if by else ()),
        )
        text = render(phrases)
        self._events.put(m.Event(name=name, level=level, text=text, phrases=phrases, about=about))
        getattr(self._log, level)(text, event_name=name, **about)

    def estop(self, requested_by: str, age_s: float = 0.0) -> None:
        """Stop the robot; the stop is repeated until safety has latched it.

        ``age_s``: since it was pressed.
        """
        now_ns = clock.now_ns()
        left_s = min(max(ESTOP_KEPT_S - age_s, 0.0), ESTOP_KEPT_S)
        self._estop_until_ns = max(self._estop_until_ns, now_ns + round(left_s * NS_PER_S))
        self.driver_lock.lapse()
        self._requests.stop()
        self.bus.estop()
        state = self.telemetry.newest(keys.SAFETY, now_ns)
        # A page sends its request twice, and repeats it.
        is_stopped = self._estop.is_pending or (state is not None and "estop" in state.latched)
        if not is_stopped or requested_by != self._stopped_by:
            self.event("estop", "warning", by=requested_by)
        self._stopped_by = requested_by
        self._estop.start(state)

    def keep_alive(self, viewer: str, answered: int, now_ns: int) -> None:
        """Keep the emergency stop alive for a page that answers this heartbeat."""
        newest = self.telemetry.newest(keys.SAFETY, now_ns)
        echo = self.keepalive.answer(viewer, self.telemetry.shown(answered), newest, now_ns)
        if echo is not None and self._keepalives:
            self._keepalives.beat(echo)

    def reset(self, echo: int, requested_by: str, notify: Notify) -> None:
        """Clear the causes that a snapshot showed as latched; report the confirmation later."""
        shown = self.telemetry.shown(echo)
        if shown is None:
            notify("warning", label("reset_refused", phrase("call.unknown_echo")))
            return
        check = ResetCheck(shown.value)
        self.event("reset_request", "info", by=requested_by)

        def answered(done: m.ResetDone) -> None:
            check.answer(done)
            self._resets.append((check, done, notify))

        def refused(refusal: m.Refusal) -> None:
            text = rendered(refusal.phrases, refusal.text)
            notify("warning", label("reset_refused", text))

        self.bus.call(keys.RESET, reset_request(shown.value), answered, refused)

    def patrol(self, asked: client.Round | client.Teach, requested_by: str, notify: Notify) -> None:
        """Make a call to patrol, which judges the age of its echo; report the answer."""

        def answered(done: m.Done) -> None:
            notify("info", rendered(done.phrases, done.text))

        def refused(refusal: m.Refusal) -> None:
            notify("warning", rendered(refusal.phrases, refusal.text))

        echo, route = asked.echo, asked.route
        if isinstance(asked, client.Round):
            self.event("round_request", "info", by=requested_by, action=asked.action)
            request = m.RoundRequest(action=asked.action, route=route, echo=echo)
            self.bus.call(keys.ROUND, request, answered, refused)
            return
        self.event("round_request", "info", by=requested_by, action=f"teach_{asked.action}")
        self.bus.call(
            keys.TEACH,
            m.TeachRequest(
                action=asked.action,
                route=route,
                station=asked.station,
                stay=asked.stay,
                echo=echo,
            ),
            answered,
            refused,
        )

    # --- requests -----------------------------------------------------------------------------

    def _on_denied(self) -> None:
        self.free_driver()
        self._broadcast("error", phrase("event.barred"))

    def _yield(self, safety: m.SafetyState | None) -> None:
        """End a hold while another source drives: its end must not resume our motion."""
        lock, contest = self.driver_lock, self._contest
        contest.tick(safety, requests=lock.state is HoldState.HELD)
        if contest.is_lost:
            self._overruled = True
            lock.lapse()
        self._overruled = self._overruled and bool(contest.other and lock.driver)

    def _requested(self, push: Push) -> m.Drive:
        if push.release:
            return request(release=push.release)
        gear = self.driver_lock.gear - 1
        linear, angular = (speeds[gear] for speeds in self._gears)
        return request(push.linear * linear, push.angular * angular)

    def _repeat_estop(self, safety: m.SafetyState | None, now_ns: int) -> None:
        step = self._estop.tick(safety)
        if step is not EstopStep.NONE:
            self.bus.estop()
        if step is EstopStep.LAST:
            name = "estop_unconfirmed" if self.may_drive else "estop_denied"
            self._broadcast("error", phrase(f"event.{name}"))
            if self.may_drive and now_ns < self._estop_until_ns:
                self._estop.start(safety)

    def _check_resets(self, state: m.SafetyState | None, now_ns: int) -> None:
        """Report the resets that safety's state confirms, or does not confirm in time."""
        waiting, self._resets = self._resets, []
        for check, done, notify in waiting:
            outcome = check.outcome(state, now_ns)
            if outcome is None:
                self._resets.append((check, done, notify))
            elif outcome:
                is_partial = state is not None and state.latched
                notify("warning" if is_partial else "info", rendered(done.phrases, done.text))
            else:
                notify("error", phrase("event.reset_unconfirmed"))

    # --- telemetry ----------------------------------------------------------------------------

    def _on_message(self, arrival: Arrival[Any]) -> None:
        self.telemetry.update(path_of(arrival.key), arrival.message, arrival.received_ns)
        if isinstance(arrival.message, m.PatrolState):
            self.routes.observe(arrival.message)

    def _on_event(self, arrival: Arrival[m.Event]) -> None:
        service, event = arrival.key.rpartition("/")[2], arrival.message
        self.telemetry.add_event(service, event)
        if (service, event.name) == ("patrol", "route_changed"):
            self.routes.change()
