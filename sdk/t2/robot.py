"""One robot: its streams, its calls, and what may be sent to it."""

import concurrent.futures.thread  # noqa: F401 - before our function for the end, below
import re
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, TypeVar

import msgspec
import zenoh

from t2 import keys
from t2 import messages as m
from t2.client import (
    ESTOP_TICKS,
    EstopRepetition,
    EstopStep,
    ResetCheck,
    request,
    reset_request,
)
from t2.codec import decode, encode, refusal
from t2.drive import Drive, attended_s, dropped
from t2.errors import (
    Late,
    LinkError,
    NoData,
    NotAllowed,
    NotConfirmed,
    Overruled,
    Refused,
    T2Error,
)
from t2.motion import check_word, finite
from t2.patrol import Patrol
from t2.publisher import PERIOD_S, DrivePublisher, FixPublisher
from t2.stream import LIVE_S, Stream, check_process, now_s, stack_version
from t2.third_party import Keepalive, SpeedLimit

A = TypeVar("A", bound=msgspec.Struct)
R = TypeVar("R", bound="Robot")
M = TypeVar("M", bound=m.Message)

EVENTS_DEPTH = 100  # events that wait for a slow reader
CALL_S = 2.0
SLOW_S = 5.0  # for an answer over a slow link
SOURCES = re.compile(r"safety\.sources\.([^.]+)\.priority")
MATCH_S = 1.0  # until the router has announced the service
COVARIANCE = 9  # numbers
STANDSTILL_S = 2.0  # a release is refused until the vehicle stands
SOURCE = re.compile("[a-z][a-z0-9_-]{0,31}")
SWITCH = "use the vehicle's own switch"
ENDED = "the main thread has ended, and its robots are closed: let it wait for the other threads"

OPEN = set["Robot"]()  # of this process
ending = threading.Event()


def close_all() -> None:
    """Close what is open when the main thread ends: Python waits for Zenoh's threads.

    Nothing can be opened from now on.
    """
    ending.set()
    robots = [*OPEN]
    for robot in robots:
        robot.end()
    for robot in robots:
        with suppress(Exception):  # in a fork, for example; nobody is left to act on it
            robot.close()


# `atexit` is too late: Python has waited for all threads then. The last function that was
# registered runs first, and that of concurrent.futures waits for its threads.
threading._register_atexit(close_all)  # type: ignore[attr-defined]


class Robot:
    """A robot, from ``connect``; use it in ``with``, or ``close`` it.

    Each stream is subscribed on first use.

    >>> robot.safety.latest().verdict in ("run", "slow", "stop", "brake", "inhibited")
    True
    >>> robot.led(channel=1, mode=1)
    >>> robot.set_pose(x=1.0)
    >>> limit = robot.limit("detector", linear=0.3, reason="person ahead", seconds=1)
    >>> limit.end()
    >>> robot.estop()
    >>> robot.safety.latest().latched
    ('estop',)
    >>> time.sleep(1)  # look at the vehicle
    >>> _ = robot.reset()
    """

    def __init__(self, session: zenoh.Session, name: str, endpoint: str) -> None:
        self.name = name
        self.endpoint = endpoint  # of the router
        self._session = session
        self._drives: list[Drive] = []
        self._limits: dict[str, SpeedLimit] = {}
        self._keepalives: dict[str, Keepalive] = {}
        self._fixes: dict[str, FixPublisher] = {}
        self._streams: list[Stream[Any]] = []
        self.odometry: Stream[m.Odometry] = self._stream("odometry", keys.ODOMETRY)
        self.localization: Stream[m.MapPose] = self._stream("pose in the map", keys.MAP_POSE)
        self.safety: Stream[m.SafetyState] = self._stream("safety", keys.SAFETY)
        self.velocity: Stream[m.Velocity] = self._stream("velocity", keys.VELOCITY)
        self.mileage: Stream[m.Mileage] = self._stream("mileage", keys.MILEAGE)
        self.ultrasonic: Stream[m.Ultrasonic] = self._stream("ultrasonic", keys.ULTRASONIC)
        self.bumper: Stream[m.Bumper] = self._stream("bumper", keys.BUMPER)
        self.switches: Stream[m.Switches] = self._stream("switches", keys.SWITCHES)
        self.link: Stream[m.Link] = self._stream("link", keys.LINK)
        self.events: Stream[m.Event] = self._stream(
            "events", keys.EVENTS, EVENTS_DEPTH, service="*"
        )
        self.patrol: Patrol = Patrol(session, name, self.safety, self._call)
        self._streams.append(self.patrol)
        OPEN.add(self)
        if ending.is_set():
            self.close()
            raise LinkError(ENDED)

    @property
    def version(self) -> str:
        """The version of the robot's stack; waits for the next message of its health."""
        self.safety.check()
        if found := stack_version(self._session, self.name):
            return found
        raise NoData(f"no health of safety of robot {self.name}: is the stack running?")

    def __enter__(self: R) -> R:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End drives with zeros, end limits, and disconnect."""
        check_process()
        OPEN.discard(self)
        for drive in self._drives:
            drive.close()
        for each in (*self._limits.values(), *self._keepalives.values()):
            each.end()
        for stream in self._streams:
            stream.close()
        self._session.close()

    def end(self) -> None:
        """End the drives with zeros, without waiting for that."""
        for drive in self._drives:
            drive.end()

    # --- moving -------------------------------------------------------------------------------

    def drive(self, source: str) -> Drive:
        """Return a drive as this source, for ``with``; safety must know the source.

        ``safety.sources`` lists the sources with their priorities.
        """
        self._drives = [each for each in self._drives if each.is_open]
        drive = Drive(self._session, self._source_key(keys.DRIVE, source), source, self)
        self._drives.append(drive)
        return drive

    def limit(
        self,
        source: str,
        linear: float | None = None,
        angular: float | None = None,
        reason: str = "",
        *,
        seconds: float,
    ) -> SpeedLimit:
        """Cap the speed in m/s and rad/s as this source, until the limit's ``end`` or another call.

        Zero is a protective stop, None no cap; ``reason`` is shown to operators. A thread repeats
        it for ``seconds`` at most: a program that hangs then falls silent, which safety's setting
        ``silence`` for this source can treat as a stop. Returns once safety's state shows the
        limit. ``safety.limits`` must list the source. Raises ``NotAllowed``, ``ValueError``,
        ``TypeError``, and ``NoData`` without safety.
        """
        if source not in self._limits or self._limits[source].has_ended:
            key = self._source_key(keys.LIMIT, source)
            self._limits[source] = SpeedLimit(self._session, key, source, self.safety)
        self._limits[source].set(linear, angular, reason, seconds=seconds)
        return self._limits[source]

    def keepalive(self, source: str, *, seconds: float) -> Keepalive:
        """Keep the emergency stop of this name alive, as a pendant, for some seconds from now.

        A thread repeats the sign of life; call this, or the keepalive's ``renew``, in a loop. The
        end of the program, of the link or of the loop lets safety brake and latch, after the
        lease of the source. Returns once safety's state shows it as alive; ``safety.limits`` must
        list the name with ``silence = "latch"``. Raises as ``limit``.
        """
        if source not in self._keepalives or self._keepalives[source].has_ended:
            key = self._source_key(keys.LIMIT, source)
            self._keepalives[source] = Keepalive(self._session, key, source, self.safety)
        self._keepalives[source].renew(seconds=seconds)
        return self._keepalives[source]

    # --- stopping -----------------------------------------------------------------------------

    def estop(self) -> None:
        """Stop the robot and latch it; repeated until safety confirms. Raises ``NotConfirmed``."""
        self.put_estop()  # before anything else
        begin_s, repetition = now_s(), EstopRepetition()
        repetition.start(None)
        self.safety.open()
        while repetition.is_pending:
            time.sleep(PERIOD_S)
            # An older state may show the latch of an earlier stop.
            is_newer = self.safety.age < now_s() - begin_s
            if repetition.tick(self.safety.newest if is_newer else None) is EstopStep.NONE:
                return
            self.put_estop()
        raise NotConfirmed(
            "the emergency stop was sent, and safety does not confirm it within "
            f"{ESTOP_TICKS * PERIOD_S:g} s: {SWITCH}. A certificate without the right to stop is "
            "one reason"
        )

    def put_estop(self) -> None:
        """Send one emergency stop, without waiting for safety; ``estop`` confirms it."""
        self.safety.check()
        self._session.put(
            keys.estop_key(self.name),
            b"",
            priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.DROP,
            express=True,
        )

    def reset(self) -> m.ResetDone:
        """Clear the causes that are latched now; return safety's answer.

        A later cause is not cleared. Raises ``Refused`` with the reason, ``NotConfirmed`` when
        safety's state does not show the effect, and ``NoData`` without safety.
        """
        seen = self.safety.latest()
        check = ResetCheck(seen)
        done = self._call(keys.RESET, reset_request(seen))
        check.answer(done)
        while (is_confirmed := check.outcome(self.safety.latest(), time.monotonic_ns())) is None:
            time.sleep(PERIOD_S)
        if is_confirmed:
            return done
        raise NotConfirmed("safety answered the reset, and its state does not show the effect")

    def release(
        self,
        direction: m.Direction,
        source: str,
        timeout: float = 5.0,
        ended: threading.Event | None = None,
    ) -> None:
        """Move off a pressed bumper, "forward" or "backward"; return once the bumper is free.

        As an operator who holds a release as this source, which needs ``operator`` in
        ``safety.sources``: at most 0.1 m/s and 0.15 m, and ``contact`` stays latched until
        ``reset``. Know which direction is free: the bumper has none. Another thread may end it
        with ``ended``. Raises ``Refused`` with the reason, ``NotAllowed``, ``Overruled``,
        ``NotConfirmed`` after ``timeout`` s, ``NoData``, and ``ValueError``.
        """
        check_word(direction, m.Direction)
        publisher = DrivePublisher(self._session, self._source_key(keys.DRIVE, source), self.safety)
        begin_s, is_known = now_s(), False
        try:
            while (passed_s := now_s() - begin_s) < timeout:
                if ended is not None and ended.is_set():
                    break
                state = self.safety.latest()
                if not self.bumper.latest().pressed:
                    return
                if publisher.denied:
                    raise dropped(source, self.name)
                is_known = is_known or state.source == source
                if passed_s > STANDSTILL_S and not is_known:
                    raise self.unheard(source, state)
                is_refused = state.source == source and bool(state.release_refusal)
                if is_refused and passed_s > STANDSTILL_S:
                    raise Refused(state.release_refusal)
                # After a refusal safety wants a neutral request: let go, then request it again.
                is_held = not is_refused and attended_s() > 0.0
                publisher.tick(request(release=direction) if is_held else None)
                time.sleep(PERIOD_S)
        finally:
            publisher.stop()
            publisher.close()
        raise NotConfirmed(f"the bumper is still pressed after {passed_s:.1f} s of release")

    # --- calls --------------------------------------------------------------------------------

    def led(self, channel: int, mode: int, **settings: int) -> None:
        """Set one lamp channel; ``settings`` are the further fields of ``LedRequest``.

        Raises ``Refused`` and ``TypeError``.
        """
        self._call(keys.SET_LED, m.LedRequest(channel=channel, mode=mode, **settings))

    def set_pose(self, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Set the pose of odometry in ``odom``: m, m, rad. Raises ``Refused``."""
        echo = self.safety.latest().heartbeat
        request = m.PoseRequest(x=finite(x), y=finite(y), heading=finite(heading), echo=echo)
        self._call(keys.SET_POSE, request)

    def place(
        self, x: float, y: float, heading: float, sigma: float = 0.1, heading_sigma: float = 0.1
    ) -> None:
        """Say where the standing vehicle is in ``map``: m, m, rad, and standard deviations.

        Returns once the pose in the map shows it. Raises ``Refused``, and ``NoData`` without
        localization.
        """
        before, echo = self.localization.latest(), self.safety.latest().heartbeat
        request = m.PlaceRequest(
            x=finite(x),
            y=finite(y),
            heading=finite(heading),
            sigma=finite(sigma),
            heading_sigma=finite(heading_sigma),
            echo=echo,
        )
        self._call(keys.PLACE, request)
        while (now := self.localization.latest()).placement == before.placement:
            if now.boot != before.boot:
                raise NoData("localization restarted: the placement may be lost")
            time.sleep(PERIOD_S)

    def fix(
        self,
        source: str,
        x: float,
        y: float,
        heading: float | None,
        covariance: Sequence[float],
        *,
        odometry: m.Odometry,
    ) -> None:
        """Send a pose of the vehicle in ``map`` that this program has measured: m, m, rad.

        ``odometry`` is the newest message that had been received when it was measured, so that the
        fix counts for that moment. ``covariance`` has 9 numbers, 3x3 row by row over x, y, heading.
        ``localization.latest().sources`` shows what became of it. Raises ``NotAllowed``,
        ``NoData`` without localization, and ``ValueError``.
        """
        known = [each.source for each in self.localization.latest().sources]
        if source not in known:
            names = ", ".join(known) or "none"
            raise NotAllowed(
                f"localization.sources does not list {source!r}; it lists {names}: add it to the "
                "robot's settings"
            )
        if len(covariance) != COVARIANCE:
            raise ValueError(f"a covariance has {COVARIANCE} numbers, not {len(covariance)}")
        if source not in self._fixes:
            key = self._source_key(keys.FIX, source)
            self._fixes[source] = FixPublisher(self._session, key)
        self._fixes[source].put(
            m.Fix(
                x=finite(x),
                y=finite(y),
                heading=None if heading is None else finite(heading),
                covariance=tuple(finite(each) for each in covariance),
                odom_boot=odometry.boot,
                odom_seq=odometry.seq,
            )
        )

    def _call(self, call: keys.Call[Any, A], request: msgspec.Struct) -> A:
        self.safety.check()
        key = call.on(self.name)
        payload = encode(request)
        for answer in self._session.get(
            key, payload=payload, timeout=CALL_S, congestion_control=zenoh.CongestionControl.DROP
        ):
            if answer.ok is not None:
                return decode(answer.ok.payload.to_bytes(), call.reply)
            payload = answer.err.payload.to_bytes() if answer.err else b""
            if payload != b"Timeout":  # Zenoh's own
                raise Refused(refusal(payload).text)
        raise self._unanswered(key, call.server)

    def _unanswered(self, key: str, service: str) -> T2Error:
        """Return why: the router announces no queryable to a certificate that may not call it."""
        querier: Any = self._session.declare_querier(key)
        try:
            token = keys.live_key(self.name, service, "*")
            found = self._session.liveliness().get(token, timeout=LIVE_S)
            runs = any(it.ok is not None for it in found)
            end_s = now_s() + MATCH_S
            while not querier.matching_status.matching and now_s() < end_s:
                time.sleep(PERIOD_S)
            is_barred = runs and not querier.matching_status.matching
        finally:
            querier.undeclare()
        if is_barred:
            return NotAllowed(
                f"no answer from {service}, though it runs: this certificate may not call it; "
                "see `t2 keys list`"
            )
        return NoData(f"no answer from {key}: is {service} running? `t2 doctor` finds the reason")

    def unheard(self, source: str, state: m.SafetyState) -> T2Error:
        """Return why safety, in this state, does not follow a source that sends requests."""
        if state.source is not None:
            return Overruled(state.source)
        begin_s, settings = now_s(), self._settings("safety")
        round_trip_s = now_s() - begin_s
        names = [found[1] for path in settings if (found := SOURCES.fullmatch(path))]
        if source in names:
            return Late(
                f"safety has received no request of {source!r} in time: the link to the robot is "
                f"slow (a round trip took {round_trip_s:.2f} s now), or other traffic holds it up. "
                f"Safety's state: {state.text}"
            )
        return NotAllowed(
            f"safety takes no requests of {source!r}: is it one of safety.sources "
            f"({', '.join(names) or 'unknown'})? Safety's state: {state.text} See `t2 doctor`"
        )

    def _settings(self, service: str) -> dict[str, Any]:
        """Return the running settings of a service by path; none without an answer."""
        key = keys.info_key(self.name, service, "config")
        for answer in self._session.get(key, timeout=SLOW_S):
            if answer.ok is not None:
                with suppress(msgspec.MsgspecError):
                    return msgspec.json.decode(
                        answer.ok.payload.to_bytes(), type=dict[str, dict[str, Any]]
                    )
        return {}

    def _stream(self, what: str, topic: keys.Topic[M], depth: int = 1, **names: str) -> Stream[M]:
        key = topic.on(self.name, **names)
        made = Stream(self._session, key, topic.message, what, depth)
        self._streams.append(made)
        return made

    def _source_key(self, topic: keys.Topic[Any], source: str) -> str:
        if not SOURCE.fullmatch(source):
            raise NotAllowed(
                f"{source!r} cannot be a source: its name has 1 to 32 characters of a-z, 0-9, _ "
                "and -, and begins with a letter"
            )
        return topic.on(self.name, source=source)
