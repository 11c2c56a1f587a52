"""Driving: requests 20 times a second, and motions by distance and angle on odometry."""

import math
import threading
import time
from collections.abc import Callable, Iterable
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

import zenoh

from t2.client import Contest, is_blocked, is_stopped, request
from t2.errors import (
    Blocked,
    Latched,
    Late,
    Lost,
    NoData,
    NotAllowed,
    Overruled,
    PoseSet,
    Stopped,
    T2Error,
)
from t2.messages import MapPose, Odometry, PlaneFrame
from t2.motion import (
    CORRECTION,
    FASTEST,
    STILL,
    Arc,
    Frame,
    Motion,
    OnStop,
    Path,
    Place,
    Progress,
    Straight,
    Target,
    Turn,
    check_word,
    finite,
    not_negative,
)
from t2.publisher import FRESH_S, PERIOD_S, DrivePublisher
from t2.stream import check_process, now_s

if TYPE_CHECKING:
    from t2.robot import Robot
    from t2.stream import Stream

NEUTRAL = 3  # zero requests before a drive: safety obeys a program after the first one
READY_S = 2.0  # from the first neutral request until we are in control
PATIENCE_S = 3.0  # without progress
STEP_S = 0.3  # a motion's velocity is valid; odometry renews it every 0.04 s
HELD_S = 1.0  # of this program: ends a drive
UNHEARD_S = 1.0  # of requests that safety refuses as too late: ends a drive
BLOCKED_S = 1.0  # of the event loop that waits for a motion: ends it
VALID_S, LONGEST_S = 0.5, 10.0  # a velocity of the program is valid, by default and at most
WAIT_S = 60.0  # for the end of a stop; a vehicle that stood for longer must not surprise anybody
SPEED, TURN_SPEED = 0.3, 0.5  # m/s, rad/s, of motions
ATTEMPTS = 3  # to reach the end of a path in the map
STANDING = 0.02  # m/s and rad/s
CLOSED = "this drive is closed, or not entered yet: use `with robot.drive(...) as drive`"


OPEN = set[tuple[int, str]]()  # boots and keys of the open drives of this program


class Attention:
    """The sign of life of the event loop that waits for a motion in a thread."""

    def __init__(self) -> None:
        self.renew()

    def renew(self) -> None:
        """Note that the loop runs."""
        self.renewed_s = now_s()


ATTENTION: ContextVar[Attention | None] = ContextVar("ATTENTION", default=None)


def attended_s() -> float:
    """Return for how many s from now a motion may request a velocity; raise ``Late``."""
    attention = ATTENTION.get()
    silent_s = now_s() - attention.renewed_s if attention else 0.0
    if silent_s > BLOCKED_S:
        raise Late(
            f"the event loop was blocked for {silent_s:.1f} s during a motion: await what takes "
            "long, or use asyncio.to_thread"
        )
    return max(0.0, STEP_S - silent_s)


class Drive:
    """Drives as one source while it is open; each method raises what stopped the vehicle.

    In ``with`` it sends neutral requests until safety lets the source drive, and zeros at the end.
    Each velocity has an end: a thread repeats it until then, and zero afterwards. The end of the
    main thread closes the drive. When the process dies, safety stops the vehicle within its lease.
    After an error the drive requests zero for good, and each method raises it: open another one.

    A motion ends with the pose and its covariance, and waits for standstill. It raises ``Blocked``
    after ``patience`` s without progress. While its thread is held up or odometry is silent, the
    request is zero after 0.3 s. When safety stops the vehicle with a cause that wants a
    neutral request, ``on_stop="raise"`` raises ``Stopped``; ``"wait"`` sends the neutral request
    and goes on after the stop, or when an obstacle is gone, for 60 s at most. A latched cause,
    another source, and the silence of safety or odometry always raise.

    >>> with robot.drive("nav") as drive:
    ...     pose = drive.forward(0.1)  # m
    ...     pose = drive.turn(-math.pi / 8, on_stop="wait")  # rad
    ...     pose = drive.arc(0.5, math.pi / 8)  # m, rad
    ...     pose = drive.follow([(0.3, 0.0), (0.3, 0.3)])  # m in odom
    ...     pose = drive.goto(0.2, 0.2, heading=0.0)  # m, m, rad; frame="map" for the map
    ...     drive.velocity(-0.1, 0.2, seconds=0.5)  # m/s, rad/s; returns at once
    ...     time.sleep(0.2)  # something else
    ...     drive.check()
    ...     drive.stop()
    """

    def __init__(self, session: zenoh.Session, key: str, source: str, robot: "Robot") -> None:
        self.source = source
        self._robot = robot
        self._publisher = DrivePublisher(session, key, robot.safety)
        self._key = (self._publisher.boot, key)
        self._target = STILL
        self._sent = 0  # requests
        self._contest = Contest(source)
        self._obeyed_s = math.inf  # time of the last request without a stop
        self._heard_s = math.inf  # time of the last request that safety received, or that is zero
        self._ticked_s = math.inf  # time of the last request
        self._error: T2Error | None = None  # for good, see the class
        self._reported = False  # whether it was raised
        self._cancelled = False
        self._motion = threading.Lock()  # held during a motion
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"t2 drive {source}", daemon=True)

    @property
    def is_open(self) -> bool:
        """Whether requests are sent, or will be."""
        return not self._ended.is_set()

    @property
    def obeyed(self) -> bool:
        """Whether the vehicle follows these requests now: safety names the source, and no stop."""
        state = self._robot.safety.newest
        return (
            self.is_open
            and self._error is None
            and state is not None
            and self._robot.safety.age <= FRESH_S
            and state.source == self.source
            and state.verdict in {"run", "slow"}
        )

    def __enter__(self) -> "Drive":
        """Start with neutral requests; return once safety would let this source drive.

        Raises ``Latched``, ``Stopped``, ``Overruled``, ``NotAllowed``, ``Late`` and ``NoData``.
        """
        if not self.is_open:
            raise T2Error(CLOSED)
        state = self._robot.safety.latest(READY_S)  # the first one, over a slow link
        if state.latched:
            raise Latched.of(state)
        if self._key in OPEN:
            raise T2Error(f"a drive as {self.source!r} is open in this program; close it first")
        OPEN.add(self._key)
        try:
            self._thread.start()
            self._await_control()
        except BaseException:
            self.close()
            OPEN.discard(self._key)
            raise
        return self

    def __exit__(self, kind: "type[BaseException] | None", *_: object) -> None:
        """Send zeros; raise what stopped the vehicle, unless it was raised before."""
        self.close()
        if kind is None and not self._reported:
            self._raise()

    def close(self) -> None:
        """Send zeros and end the requests."""
        self.end()
        if self._thread.is_alive():
            self._thread.join()

    def end(self) -> None:
        """Send zeros and end the requests, without waiting for that."""
        self._ended.set()

    def check(self) -> None:
        """Raise what stopped the vehicle, if anything did."""
        check_process()
        self._raise()
        if not (self.is_open and self._thread.is_alive()):
            raise T2Error(CLOSED)

    def _raise(self) -> None:
        if self._error is not None:
            self._target, self._reported = STILL, True
            raise self._error

    def cancel(self) -> None:
        """End the motion of another thread, or the next one, with an error, and request zero."""
        self._cancelled = True

    def uncancel(self) -> None:
        """Forget a cancel after the end of the motion; the request is zero."""
        self._target = STILL  # before the flag: the thread reads them in the other order
        self._cancelled = False

    # --- motions ------------------------------------------------------------------------------

    def velocity(
        self,
        linear: float,
        angular: float = 0.0,
        *,
        seconds: float = VALID_S,
        on_stop: OnStop = "raise",
    ) -> None:
        """Request m/s and rad/s for some seconds from now, 10 at most; return at once.

        Open loop. Call it again before its end to go on; a program that hangs, sleeps or waits for
        something else does not drive on.
        """
        check_word(on_stop, OnStop)
        if seconds > LONGEST_S:
            raise ValueError(
                f"a velocity is valid for {LONGEST_S:g} s at most, not {seconds}: call it again "
                "before its end to go on"
            )
        end_s = now_s() + not_negative(seconds, "seconds")
        target = Target(finite(linear), finite(angular), end_s, on_stop)
        self.check()
        self._end_cancelled()
        self._error = self._error or self._stop_of(target)
        self._raise()
        self._target = target

    def stop(self) -> None:
        """Request zero and wait until the vehicle stands."""
        self.velocity(0.0)
        self._until(lambda pose: abs(pose.linear) < STANDING and abs(pose.angular) < STANDING)

    def forward(
        self,
        distance: float,
        speed: float = SPEED,
        patience: float = PATIENCE_S,
        *,
        on_stop: OnStop = "raise",
    ) -> Odometry:
        """Drive straight for a distance in m, negative backward."""
        return self._go(Straight(self._pose(), distance, speed), patience, on_stop)

    def turn(
        self,
        angle: float,
        speed: float = TURN_SPEED,
        patience: float = PATIENCE_S,
        *,
        on_stop: OnStop = "raise",
    ) -> Odometry:
        """Turn on the spot by an angle in rad, positive to the left; ``speed`` in rad/s."""
        return self._go(Turn(self._pose(), angle, speed), patience, on_stop)

    def arc(
        self,
        radius: float,
        angle: float,
        speed: float = SPEED,
        patience: float = PATIENCE_S,
        *,
        on_stop: OnStop = "raise",
    ) -> Odometry:
        """Drive forward along a circle of ``radius`` m by an angle in rad, positive to the left."""
        return self._go(Arc(self._pose(), radius, angle, speed), patience, on_stop)

    def follow(
        self,
        points: Iterable[tuple[float, float]],
        speed: float = SPEED,
        patience: float = PATIENCE_S,
        *,
        heading: float | None = None,
        frame: Frame = "odom",
        on_stop: OnStop = "raise",
    ) -> Odometry:
        """Drive forward along straight lines through points (x, y), m; then turn to a heading, rad.

        It cuts corners by up to 0.2 m, at more than 0.3 m/s by two thirds of what it drives in 1 s,
        and turns on the spot where the next line is not ahead. With
        ``frame="map"`` points and heading are in the map, and the vehicle comes back to the lines
        after each correction of its pose; raises ``Lost`` while the pose is not known well enough.
        The result is in ``odom`` all the same.
        """
        check_word(frame, Frame)
        if heading is not None:
            finite(heading)  # before it drives
        ends = [(finite(x), finite(y)) for x, y in points]
        path = Path(place_of(self._stream(frame).latest()), ends, speed, TURN_SPEED)
        pose = self._go(path, patience, on_stop, frame)
        attempts = 1
        while ends and frame == "map" and self._is_off(ends[-1]):  # by a correction near the end
            if attempts == ATTEMPTS:
                raise Lost(f"the pose in the map changed at the end of {ATTEMPTS} attempts")
            attempts += 1
            path = Path(place_of(self._stream(frame).latest()), ends[-1:], speed, TURN_SPEED)
            pose = self._go(path, patience, on_stop, frame)
        if heading is None:
            return pose
        now = place_of(self._stream(frame).latest())
        angle = math.remainder(heading - now.heading, math.tau)
        return self.turn(angle, patience=patience, on_stop=on_stop)

    def goto(
        self,
        x: float,
        y: float,
        heading: float | None = None,
        speed: float = SPEED,
        patience: float = PATIENCE_S,
        *,
        frame: Frame = "odom",
        on_stop: OnStop = "raise",
    ) -> Odometry:
        """Drive to a place, m, straight there; then turn to a heading in rad. As ``follow``."""
        return self.follow([(x, y)], speed, patience, heading=heading, frame=frame, on_stop=on_stop)

    def _is_off(self, end: tuple[float, float]) -> bool:
        """Return whether the vehicle is not at a point of the map."""
        now = place_of(self._robot.localization.latest())
        return math.dist((now.x, now.y), end) > CORRECTION

    def _pose(self) -> Odometry:
        return self._robot.odometry.latest()

    def _stream(self, frame: Frame) -> "Stream[Any]":
        return self._robot.odometry if frame == "odom" else self._robot.localization

    def _go(
        self, motion: Motion, patience: float, on_stop: OnStop, frame: Frame = "odom"
    ) -> Odometry:
        """Follow a motion until little is left; raise ``Blocked`` without progress."""
        check_word(on_stop, OnStop)
        progress = Progress(motion, patience, WAIT_S, now_s())
        before = self._stream(frame).latest()
        left = motion.left(place_of(before))

        def arrived(pose: Odometry | MapPose) -> bool:
            nonlocal left, before
            place = place_of(pose)
            left = motion.left(place)
            if left <= motion.near:
                return True
            linear, angular = motion.velocity(place, left)
            state = self._robot.safety.latest()
            waits = on_stop == "wait" and (is_stopped(state) or is_blocked(state))
            if is_corrected(before, pose):
                progress.restart(left, now_s())
            before = pose
            if progress.ends(left, motion.turning, now_s(), waits=waits):
                raise Blocked(f"The vehicle does not get on: {state.text}", state.causes)
            self.velocity(linear, angular, seconds=attended_s(), on_stop=on_stop)
            return False

        if not self._motion.acquire(blocking=False):
            raise T2Error("a motion of this drive is under way; wait for its end, or cancel it")
        self._target = STILL  # an old one must not be judged as the motion
        try:
            self._until(arrived, frame)
            self.stop()
            return self._pose()
        except T2Error as error:
            error.left, error.unit = max(left, 0.0), motion.unit
            raise
        finally:
            self._target = STILL
            self._motion.release()

    def _until(self, arrived: Callable[[Any], bool], frame: Frame = "odom") -> None:
        """Call a function with each pose in a frame, until it returns true."""
        stream = self._stream(frame)
        start = stream.latest()
        with stream.reading() as queue:
            while True:
                pose = stream.after(queue, 1.0)
                self._check_pause(self._target)  # after one, everything seems silent
                self._end_cancelled()
                self.check()
                if pose is None:
                    self._target = STILL
                    service = "odometry" if frame == "odom" else "localization"
                    raise NoData(f"{service} fell silent during a motion; see `t2 doctor`")
                try:
                    check_continuity(start, pose)
                except T2Error:
                    self._target = STILL
                    raise
                if arrived(pose):
                    return

    def _end_cancelled(self) -> None:
        if self._cancelled:
            self.uncancel()
            raise T2Error("the motion was cancelled")

    # --- requests -----------------------------------------------------------------------------

    def _await_control(self) -> None:
        end_s, asked_at = now_s() + READY_S, None
        while now_s() < end_s:
            self.check()
            state = self._robot.safety.latest()
            if asked_at is None and self._sent >= NEUTRAL:
                asked_at = state.seq
            # An older state may name the source for requests of an earlier program.
            is_answer = asked_at is not None and state.seq > asked_at + 1
            if is_answer and state.source == self.source and not is_stopped(state):
                return
            time.sleep(PERIOD_S)
        if state.source == self.source:
            raise Stopped(state.text, state.causes)
        raise self._robot.unheard(self.source, state)

    def _run(self) -> None:
        try:
            while not self._ended.wait(self._pause_s()):
                self._tick()
            self._publisher.stop()
        except Exception as error:  # the session was closed, for example
            ended = T2Error(f"the drive has ended: {error!r}")
            self._error = self._error or ended.with_traceback(error.__traceback__)
        self._ended.set()
        OPEN.discard(self._key)
        self._publisher.close()

    def _pause_s(self) -> float:
        """Return the time until the next request: a period, or less to be there for the end."""
        left_s = self._target.end_s - now_s()
        return left_s if 0.0 < left_s < PERIOD_S else PERIOD_S

    def _tick(self) -> None:
        cancelled, target = self._cancelled, self._target
        self._check_pause(target)
        self._ticked_s = now_s()
        is_over = now_s() >= target.end_s
        # A motion that is held up requests zero, and a stop ends it all the same.
        if cancelled or (is_over and not self._motion.locked()):
            target = STILL
        self._error = self._error or self._trouble(target)
        state = self._robot.safety.newest
        # In a stop that is waited for, each request is the neutral one that safety wants after it.
        if is_over or self._error is not None or (state is not None and is_stopped(state)):
            target = STILL
        self._publisher.tick(request(target.linear, target.angular))
        self._sent += 1

    def _check_pause(self, target: Target) -> None:
        """End the drive when this program was held up while it moved the vehicle."""
        before_s = self._ticked_s
        held_s = now_s() - before_s
        moved = self._motion.locked() or (target.moves and target.end_s > before_s)
        if moved and held_s > HELD_S:
            self._error = self._error or Late(
                f"this program was held up for {held_s:.1f} s, suspended for example, and the "
                "vehicle stopped: open another drive to go on"
            )

    def _trouble(self, target: Target) -> "T2Error | None":
        safety = self._robot.safety
        state = safety.newest
        if state is None or safety.age > FRESH_S:
            return NoData("safety is silent, and the vehicle stops; see `t2 doctor`")
        self._contest.tick(state, requests=target.moves)
        if not target.moves or state.source is not None or is_stopped(state):
            self._heard_s = now_s()
        if stop := self._stop_of(target):
            return stop
        if self._publisher.denied:
            return dropped(self.source, self._robot.name)
        if now_s() - self._heard_s > UNHEARD_S:
            return Late(
                f"safety has received no request of {self.source!r} in time for {UNHEARD_S:g} s: "
                "the link to the robot is slow"
            )
        if self._contest.is_lost:
            return Overruled(str(self._contest.other))
        return None

    def _stop_of(self, target: Target) -> Stopped | None:
        """Return the stop that ends this drive if it requests this now."""
        state = self._robot.safety.newest
        if state is None:
            return None
        if state.latched:
            return Latched.of(state)
        now = now_s()
        if not (target.moves and is_stopped(state)) or self._contest.other:
            self._obeyed_s = now
            return None
        if target.on_stop == "wait" and now - self._obeyed_s < WAIT_S:
            return None
        return Stopped(f"{state.text} Open another drive to go on.", state.causes)


def dropped(source: str, robot: str) -> NotAllowed:
    """Return the error of a source whose requests do not pass the router."""
    return NotAllowed(
        f"the router drops the requests of {source!r}: this certificate may not drive robot "
        f"{robot} as this source (`t2 keys list`), or the robot's safety.sources lacks it"
    )


def place_of(pose: Odometry | MapPose) -> Place:
    """Return where the vehicle is; raise ``Lost`` while that is not known in the map."""
    if isinstance(pose, Odometry):
        return pose
    if pose.state != "placed" or pose.x is None or pose.y is None or pose.heading is None:
        raise Lost(pose.text)
    return PlaneFrame(x=pose.x, y=pose.y, heading=pose.heading)


def check_continuity(start: Odometry | MapPose, now: Odometry | MapPose) -> None:
    """Raise ``PoseSet`` when a pose does not continue the one at the start of a motion."""
    if isinstance(start, Odometry) and isinstance(now, Odometry):
        if (now.boot, now.epoch) != (start.boot, start.epoch):
            raise PoseSet("odometry restarted, or its pose was set, during a motion")
    elif isinstance(start, MapPose) and isinstance(now, MapPose):
        place_of(now)
        if (now.boot, now.placement) != (start.boot, start.placement):
            raise PoseSet("the vehicle was placed anew during a motion")


def is_corrected(before: Odometry | MapPose, now: Odometry | MapPose) -> bool:
    """Return whether localization moved the pose farther than the vehicle can drive."""
    if isinstance(now, Odometry):
        return False
    a, b = place_of(before), place_of(now)
    driven = FASTEST * (now.mono_ns - before.mono_ns) / 1e9
    turned = abs(math.remainder(b.heading - a.heading, math.tau))
    return math.dist((a.x, a.y), (b.x, b.y)) > CORRECTION + driven or turned > CORRECTION + driven
