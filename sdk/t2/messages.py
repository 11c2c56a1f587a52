"""Messages on the bus: frozen structs, SI units and radians, ``None`` for unknown.

Frames follow REP-103 and REP-105: x forward, y left, counter-clockwise positive; ``odom`` is the
start pose of odometry, ``base_link`` is the vehicle. Every message has the header of ``Message``,
set by the publisher. Readers ignore unknown fields.
"""

from enum import Enum
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta, Struct

VERSION = "0.1.0"  # of the stack, the client library and their packages

# In the manual's order: counted clockwise from the left.
SONAR_NAMES = (
    "left", "front_left", "front", "front_right", "right", "rear_right", "rear", "rear_left",
)  # fmt: skip

RangeStatus = Literal["ok", "fault", "too_near", "no_echo"]
FaultName = Literal["over_current", "over_voltage", "encoder", "under_voltage", "overload"]
LinkState = Literal["up", "lost", "never"]
Verdict = Literal["run", "slow", "stop", "brake", "inhibited"]
Level = Literal["info", "warning", "error"]
Action = Literal["slow", "stop", "brake"]
Direction = Literal["forward", "backward"]
ReleaseRequest = Literal["none", "forward", "backward"]  # off a pressed bumper
# Where the vehicle is in the map: not known yet, known, or not known well enough any more.
MapState = Literal["unplaced", "placed", "lost"]
# Where a round is in its course: ``services/patrol/core/course.py`` has the table.
RoundState = Literal[
    "idle", "announcing", "driving", "staying", "waiting", "paused", "returning", "stopped", "done",
]  # fmt: skip
RoundAction = Literal["start", "depart", "pause", "resume", "return", "abort"]
RoundResult = Literal["home", "returned", "aborted"]
WhenBlocked = Literal["wait", "return", "stop"]
# A row of the shift log: what stopped, who took over, who reset what no stop is known of, a round,
# another fact for the reader, and a time without a record.
LogKind = Literal["stop", "takeover", "reset", "round", "note", "gap"]
TeachAction = Literal["begin", "station", "end", "cancel", "save", "delete"]
# Of a camera: pictures arrive; the same one arrives while the vehicle moves; none arrives.
CameraState = Literal["up", "frozen", "lost"]
LimitEffect = Literal["none", "slow", "stop", "brake"]
# Of a source of speed limits: without effect, STOP, or BRAKE and a latch, as of a pendant.
Silence = Literal["ignore", "stop", "latch"]

# NaN and infinity are out of this range, too: a message with such a number is undecodable.
MAX_NUMBER = 1e9
Number = Annotated[float, Meta(ge=-MAX_NUMBER, le=MAX_NUMBER)]

# A longer text or list makes a message undecodable. Members that may only read publish events, too:
# one of 1 MB delayed the emergency stop of a terminal by seconds.
MAX_TEXT = 4000
Text = Annotated[str, Meta(max_length=MAX_TEXT)]
Name = Annotated[str, Meta(max_length=200)]
if TYPE_CHECKING:
    CauseName = Literal[
        "contact", "estop", "estop_reader", "estop_keepalive", "predecessor", "runaway",
        "uncommanded_motion", "not_stopping", "driver_left", "driver_right", "flapping", "leaving",
        "starting", "link", "switches", "bumper", "silent", "unarmed", "limit_stop",
        "limit_silent", "two_publishers", "neutral", "blocked", "no_request", "release", "limit",
        "obstacle", "sonar",
    ]  # fmt: skip
else:
    CauseName = Name  # the client library knows the names, for type checkers
if TYPE_CHECKING:
    EventName = Literal[
        "barred", "black_box", "black_box_lost", "board_restarted", "by_picture", "camera_frozen",
        "camera_lost", "camera_up", "cmd_vel_refused", "contact",
        "disk_full", "disk_room", "drive_link_lost", "drive_link_up", "driver_fault", "estop",
        "estop_denied", "estop_keepalive", "estop_reader", "estop_unconfirmed", "fixes_back",
        "fixes_refused", "flapping", "gamepad", "gamepad_silent", "guard_gone", "in_sight",
        "leave", "link_lost", "link_up", "log_dropped", "lost", "overruled",
        "placed", "port_changed", "pose_set", "predecessor", "reanchored", "recordings_removed",
        "relay_braking", "relay_lost", "relay_up", "release", "release_end", "release_free",
        "release_refused", "reset", "reset_refused", "reset_request", "reset_unconfirmed",
        "ros_fix_refused", "round_blocked", "round_end", "round_paused", "round_request",
        "round_resumed", "round_return", "round_skipped", "round_start", "round_stopped",
        "round_unwritten", "round_waiting", "route_changed", "runaway", "second_authority",
        "silent", "slip", "slip_over", "source", "station", "stop", "switches_unverified",
        "take", "take_over", "teaching", "terminal_slow", "uncommanded_motion", "unheard",
        "unplaced", "velocity_back",
    ]  # fmt: skip
else:
    EventName = Name
Few: Meta = Meta(max_length=128)
Many: Meta = Meta(max_length=1000)
Empty: Meta = Meta(max_length=0)
Counts = Annotated[dict[Name, int], Few]

Ranges = Annotated[tuple[Number | None, ...], Meta(min_length=8, max_length=8)]
Statuses = Annotated[tuple[RangeStatus, ...], Meta(min_length=8, max_length=8)]
Covariance3 = Annotated[tuple[Number, ...], Meta(min_length=9, max_length=9)]
Covariance2 = Annotated[tuple[Number, ...], Meta(min_length=4, max_length=4)]

InMap = Annotated[float, Meta(ge=-1e6, le=1e6)]  # m: less than a number, so that poses are numbers

Cap = Annotated[float, Meta(ge=0.0, le=MAX_NUMBER)]
# A letter or a digit of any script first: it is the name of a file, too.
RouteName = Annotated[str, Meta(pattern=r"^\w[\w-]*\Z", max_length=32)]
StationName = Annotated[str, Meta(pattern=r"^(\w[\w -]*)?\Z", max_length=32)]  # empty: no station
MAX_POINTS = 10_000  # of a route
MAX_TRACK = 2000  # poses of a driven round
MAX_REASON = 80  # characters
Reason = Annotated[str, Meta(max_length=MAX_REASON)]


CameraName = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_-]{0,31}\Z", max_length=32)]
MAX_SIDE = 4096  # pixels of a picture
MAX_PICTURE = 1_000_000  # bytes


class Command(str, Enum):
    """A motion command (manual 2.2); a frame spells BRAKE as the manual does."""

    RUN = "run"  # follow the velocities
    STOP = "stop"  # ramp down to standstill
    BRAKE = "brake"  # stop at once

    __str__ = str.__str__


class Message(Struct, frozen=True, kw_only=True):
    """The header of every message."""

    seq: int = 0  # rises by one per publisher; restarts with ``boot``
    boot: int = 0  # random per start of the sender
    t_ns: int = 0  # the sender's wall clock, for records only
    mono_ns: int = 0  # the sender's monotonic clock
    host: int = 0  # identifies that clock: random per boot of the sender's host, 0 if unknown


# A value of a phrase: a figure, a text, or a word of the catalogue; several words are a tuple.
Field = Text | int | Number | bool | None | Annotated[tuple[Name, ...], Few]


class Phrase(Struct, frozen=True, omit_defaults=True):
    """A text by its name in the catalogue ``t2.catalogue``, and the fields of its template."""

    name: Name
    fields: Annotated[dict[Name, Field], Few] = {}


Phrases = Annotated[tuple[Phrase, ...], Few]


# --- tel/bridge -----------------------------------------------------------------------------


class Velocity(Message, frozen=True, kw_only=True):
    """Measured by the board (manual 2.2)."""

    linear: Number  # m/s, forward positive
    angular: Number  # rad/s, counter-clockwise positive


class Mileage(Message, frozen=True, kw_only=True):
    """Counted by the board since it was powered on (manual 2.3)."""

    distance: Number  # m, forward positive
    heading: Number  # rad, wrapped to -pi..pi
    epoch: int  # number of board restarts that the bridge has detected


class Ultrasonic(Message, frozen=True, kw_only=True):
    """Eight ranges, counted clockwise from the left (manual 2.3, the second section 2.3)."""

    ranges: Ranges  # m; None where the status is not "ok"
    status: Statuses


class Bumper(Message, frozen=True, kw_only=True):
    """The bumper strip, one bit for the whole vehicle (manual 2.4)."""

    pressed: bool


class Driver(Message, frozen=True, kw_only=True):
    """Faults of one motor driver (manual 2.7)."""

    faults: Annotated[tuple[Name, ...], Few]  # names of the known bits, "bit_N" for reserved ones
    bits: int  # all 32, as the board sent them

    @property
    def has_fault(self) -> bool:
        """Whether the driver reports any fault."""
        return bool(self.bits or self.faults)


class Switches(Message, frozen=True, kw_only=True):
    """The board's own emergency brakes (manual 2.5 and 2.6); None until it has confirmed them."""

    ultrasonic_brake: bool | None = None
    bumper_brake: bool | None = None


class Relay(Struct, frozen=True, kw_only=True):
    """The relay between PC and board, by its newest report."""

    state: LinkState
    version: Name
    braking: Name  # why it sends BRAKE: start, silent, hit; empty while it passes commands
    uptime: Number  # s
    counters: Counts  # datagrams since its start, by what became of them


class Link(Message, frozen=True, kw_only=True):
    """State of the link to the board."""

    state: LinkState
    board: Name  # address:port
    epoch: int
    armed: bool  # whether the bridge would obey a RUN now
    waiting: Text  # why it would not; empty when armed
    waiting_phrases: Phrases = ()  # the same, for other languages
    rates: Annotated[dict[Name, Number], Few]  # frames by name, over the last second, Hz
    rejected: Counts  # frames and datagrams refused since start, by reason
    round_trip: Number | None  # s, the median of the last queries
    latched_by: int | None = None  # ``boot`` of the safety or bridge whose latch is not reset
    ports: Counts = {}  # our UDP port that each frame is taken from, by the frame's name
    send_errors: int = 0  # datagrams that the system refused to send, since start
    relay: Relay | None = None  # None without ``board.relay_port``
    estop: int | None = None  # receive time, ns, of an emergency stop that safety must still latch


# --- tel/odom, tel/safety -------------------------------------------------------------------


class Odometry(Message, frozen=True, kw_only=True):
    """Pose in ``odom`` and twist in ``base_link``."""

    x: Number  # m
    y: Number  # m
    heading: Number  # rad, wrapped to -pi..pi
    linear: Number  # m/s
    angular: Number  # rad/s
    pose_covariance: Covariance3  # 3x3 row by row over x, y, heading
    twist_covariance: Covariance2  # 2x2 row by row over linear, angular
    epoch: int  # number of times the pose was set
    residual: Number | None  # m, counters less integrated velocity over the last second
    slip: bool
    frame_id: Name = "odom"
    child_frame_id: Name = "base_link"


class FixState(Struct, frozen=True, kw_only=True):
    """The newest fix of one source, see ``Fix``."""

    source: Name
    age: Number | None  # s since it was received; None without any
    used: int  # fixes since the start of the service
    refused: int
    in_a_row: int  # refused ones since the last one that was used
    text: Text = ""  # why the newest one was refused; empty if it was used
    phrases: Phrases = ()  # the same, for other languages


class PlaneFrame(Struct, frozen=True, kw_only=True):
    """Pose of a frame in another one."""

    x: Number  # m
    y: Number  # m
    heading: Number  # rad


class MapPose(Message, frozen=True, kw_only=True):
    """Pose in ``map`` by odometry and fixes; None while the vehicle is not placed."""

    state: MapState
    x: Number | None = None  # m
    y: Number | None = None  # m
    heading: Number | None = None  # rad, wrapped to -pi..pi
    pose_covariance: Covariance3 | None = None  # 3x3 row by row over x, y, heading, axes of ``map``
    odom: PlaneFrame | None = None  # the origin of ``odom`` in ``map``
    odom_boot: int  # header of the odometry that this pose follows from
    odom_seq: int
    placement: int  # number of placements since the start of the service
    text: Text  # how certain the pose is, or why it is not known, and the next step
    phrases: Phrases = ()  # the same, for other languages
    sources: Annotated[tuple[FixState, ...], Few] = ()  # those in the settings
    frame_id: Name = "map"
    child_frame_id: Name = "base_link"


# --- tel/camera -----------------------------------------------------------------------------


class Picture(Message, frozen=True, kw_only=True):
    """A picture of a camera, with safety's newest heartbeat of the time when it was taken.

    A driver who uses this picture echoes that number. Safety then judges the age of the picture.
    """

    heartbeat: int | None = None  # ``SafetyState.heartbeat``; None: none was received by then
    safety_boot: int = 0  # of the safety service that sent it
    width: Annotated[int, Meta(ge=1, le=MAX_SIDE)]  # pixels
    height: Annotated[int, Meta(ge=1, le=MAX_SIDE)]
    jpeg: Annotated[bytes, Meta(max_length=MAX_PICTURE)]


class Camera(Message, frozen=True, kw_only=True):
    """State of a camera."""

    camera: CameraName
    state: CameraState
    rate: Cap = 0.0  # Hz, of the last second's pictures
    text: Text  # the size of its pictures, or why there are none
    phrases: Phrases = ()  # the same, for other languages


class Cause(Struct, frozen=True, kw_only=True):
    """One reason why the vehicle may not move as asked."""

    name: CauseName
    action: Action
    age: Number  # s since it became active
    text: Text  # for the operator
    phrases: Phrases = ()  # the same, for other languages
    id: int = 0  # this occurrence, see ``ResetRequest.causes``; a new one for each occurrence


class Limits(Struct, frozen=True, kw_only=True):
    """What a drive request may reach now; zero while a cause forbids every motion.

    A release has its own speed, ``safety.release_speed``.
    """

    forward: Number  # m/s
    backward: Number  # m/s, as a positive number
    angular: Number  # rad/s, either way


class Release(Struct, frozen=True, kw_only=True):
    """State of moving off a pressed bumper; the operator chooses the direction."""

    believed_free: Direction | None  # opposite of the last motion; None when none is known
    travelled: Number  # m, travel by the counters since the last reversal before the contact
    age: Number | None  # s since that motion; None when none is known
    forbidden: Annotated[tuple[Direction, ...], Few]  # until a reset: it was pressed that way
    left: Number  # m that may still be travelled until a reset


class LimitState(Struct, frozen=True, kw_only=True):
    """State of one source of speed limits, see ``Limit``."""

    source: Name
    linear: Number | None  # m/s; None: no cap
    angular: Number | None  # rad/s, likewise
    reason: Text  # in the source's words
    age: Number | None  # s since its last limit, see ``silence``; None: none was received
    lease: Number  # s that a limit holds
    silence: Silence  # what the end of the lease does; of ``latch`` the age is that of the echo
    silent: bool  # whether its lease is over, it was never received, or two programs latch
    effect: LimitEffect  # on the vehicle now


class SafetyState(Message, frozen=True, kw_only=True):
    """Safety's decision and its causes."""

    verdict: Verdict
    latched: Annotated[tuple[CauseName, ...], Few]  # names of the causes that need a reset
    causes: Annotated[tuple[Cause, ...], Few]  # all active ones, the worst first
    source: Name | None  # the driving source
    limits: Limits
    heartbeat: int  # echoed by sources, see ``Drive.echo``
    text: Text  # why the vehicle may or may not move, and the next step
    phrases: Phrases = ()  # the same, for other languages
    release: Release | None = None  # None while there is no contact
    release_refusal: Text = ""  # why the release that ``source`` requests does not move the vehicle
    refusal_phrases: Phrases = ()  # the same, for other languages
    limit_sources: Annotated[tuple[LimitState, ...], Few] = ()  # those in the settings
    doubted_sonars: Annotated[tuple[Name, ...], Few] = ()  # names of those that are not trusted


# --- tel/patrol -----------------------------------------------------------------------------


class RoutePoint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """A point of a route, and the station at it."""

    x: InMap  # m
    y: InMap  # m
    station: StationName = ""  # empty: none
    stay: Annotated[float, Meta(ge=0.0, le=86_400.0)] = 0.0  # s; the time to stay at the station


class Route(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A path in ``map`` that rounds repeat: straight lines through its points, and a corridor.

    The first point is a station, home. A file of a route has these fields as JSON.
    """

    name: RouteName
    robot: Name  # whose map it is
    speed: Annotated[float, Meta(ge=0.05, le=1.5)] = 0.5  # m/s
    corridor: Annotated[float, Meta(ge=0.2, le=5.0)] = 0.5  # m to either side
    blocked: WhenBlocked = "wait"  # what a round does that has waited for ``patrol.patience``
    points: Annotated[tuple[RoutePoint, ...], Meta(min_length=2, max_length=MAX_POINTS)]


class RouteSummary(Struct, frozen=True, kw_only=True):
    """A route of the folder, without its points."""

    name: Name
    length: Number | None = None  # m; None of a file with a problem
    stations: Annotated[tuple[Name, ...], Few] = ()
    problem: Text = ""  # why it cannot be driven; empty if it can
    phrases: Phrases = ()  # the same, for other languages


class Teaching(Struct, frozen=True, kw_only=True):
    """A route that is being taught."""

    route: Name
    length: Number  # m
    points: int
    stations: Annotated[tuple[Name, ...], Few]
    text: Text = ""  # why nothing more is recorded; empty while it is
    phrases: Phrases = ()  # the same, for other languages


class NextRound(Struct, frozen=True, kw_only=True):
    """The next round of the schedule."""

    schedule: Name
    route: Name
    t_ns: int  # wall clock of the robot


class PatrolState(Message, frozen=True, kw_only=True):
    """The round that is driven, or the last one; what may be asked of it now; the next one."""

    state: RoundState
    text: Text  # what it does, or why it does not go on, and the next step
    phrases: Phrases = ()  # the same, for other languages
    actions: Annotated[tuple[RoundAction, ...], Few] = ()  # that are possible now
    round: Name = ""  # its id; empty before the first one
    route: Name = ""
    homeward: bool = False  # whether it is on its way back along the route
    progress: Number | None = None  # m along the route from home
    length: Number | None = None  # m of the route
    station: Name = ""  # the one ahead, or where it stays
    left: Number | None = None  # s of an announcement, a stay, or the patience with an obstacle
    deviation: Number | None = None  # m from the route
    sigma: Number | None = None  # m, standard deviation of the position across the route
    corridor: Number | None = None  # m
    teaching: Teaching | None = None
    next: NextRound | None = None


class Visit(Struct, frozen=True, kw_only=True):
    """The arrival at a station."""

    station: Name
    t_ns: int  # wall clock


class Halt(Struct, frozen=True, kw_only=True):
    """A period in which a round did not get on."""

    state: RoundState  # waiting, paused or stopped
    t_ns: int  # wall clock, its begin
    seconds: Number
    x: Number  # m, in ``map``
    y: Number  # m
    text: Text
    phrases: Phrases = ()  # the same, for other languages


class Round(Struct, frozen=True, kw_only=True):
    """One execution of a route; a line of the ledger is its JSON."""

    id: Name
    route: Name
    robot: Name
    schedule: Name = ""  # that started it; empty: a call
    start_ns: int  # wall clock
    end_ns: int = 0  # wall clock; 0 while it is not over
    result: RoundResult | None = None  # None while it is not over
    text: Text = ""  # how it ended
    phrases: Phrases = ()  # the same, for other languages
    distance: Number = 0.0  # m driven
    visits: Annotated[tuple[Visit, ...], Many] = ()
    halts: Annotated[tuple[Halt, ...], Many] = ()
    deviation: Number = 0.0  # m, the greatest from the route
    sigma: Number = 0.0  # m, the greatest across the route
    margin: Number | None = None  # m, the least: corridor - deviation - 2 sigma
    recordings: Annotated[tuple[Name, ...], Few] = ()  # black boxes of this time


class TrackPoint(Struct, frozen=True, kw_only=True):
    """A pose of a driven round."""

    x: Number  # m, in ``map``
    y: Number  # m
    deviation: Number  # m from the route
    sigma: Number  # m across the route


# --- @cmd -----------------------------------------------------------------------------------


class SourceMessage(Message, frozen=True, kw_only=True):
    """A message to safety that counts only while its echo is young."""

    echo: int  # the newest ``SafetyState.heartbeat`` that the source saw


class Drive(SourceMessage, frozen=True, kw_only=True):
    """A drive request; valid for its source's lease."""

    linear: Number  # m/s
    angular: Number  # rad/s
    release: ReleaseRequest = "none"  # move slowly off a pressed bumper instead, as an operator


class Limit(SourceMessage, frozen=True, kw_only=True):
    """A speed limit by a third party; valid for its source's lease. Zero is a protective stop.

    Without a cap it is a sign of life: of an emergency stop, if the source's silence latches.
    """

    linear: Cap | None = None  # m/s, either way; None: no cap
    angular: Cap | None = None  # rad/s, likewise
    reason: Reason = ""  # for the operator, such as "person at 2 m"


class Fix(Message, frozen=True, kw_only=True):
    """A pose of the vehicle in ``map``, measured by other means: tags, GNSS, a lidar.

    It names the newest odometry that had been received when it was measured, so that no clocks are
    compared.
    """

    x: InMap  # m
    y: InMap  # m
    heading: Number | None = None  # rad; None if it is not measured
    covariance: Covariance3  # 3x3 row by row over x, y, heading; of the heading if it is measured
    odom_boot: int  # ``Odometry.boot``
    odom_seq: int  # ``Odometry.seq``


class Motion(Message, frozen=True, kw_only=True):
    """The motion that safety allows; the bridge obeys only this, for 200 ms."""

    command: Command
    linear: Number = 0.0  # m/s
    angular: Number = 0.0  # rad/s
    source: Name | None = None
    judged: int = 0  # ``seq`` of the newest bumper sample in the verdict
    judged_boot: int = 0  # ``boot`` of the bridge that sent that sample
    latched: bool = False  # whether an operator's reset is needed
    predecessor: int | None = None  # the newest ``Link.latched_by`` in the verdict
    estop: int | None = None  # the newest ``Link.estop`` in the verdict, which has latched it


# --- evt, health ----------------------------------------------------------------------------


class Event(Message, frozen=True, kw_only=True):
    """A transition: contact, stop, release, fault, board restarted, link lost."""

    name: EventName
    level: Level
    text: Text
    phrases: Phrases = ()  # the same, for other languages
    about: Annotated[dict[Name, Field], Few] = {}


class Durations(Struct, frozen=True, kw_only=True):
    """Histogram of durations since the service's start."""

    bounds: Annotated[tuple[Number, ...], Few]  # s, rising; upper bounds of the counts
    counts: Annotated[tuple[int, ...], Few]  # one for each bound, and one above
    worst: Number  # s, 0 without any


class Health(Message, frozen=True, kw_only=True):
    """Health of a service, once a second."""

    service: Name
    version: Name
    uptime: Number  # s
    rates: Annotated[dict[Name, Number], Few]  # messages by key, in the last second, Hz
    counters: Counts  # since start
    lateness: Number  # s, maximum lateness of the loop's timers in the last second
    rss: int  # bytes
    priority: int = 0  # of SCHED_FIFO; 0 for normal priority
    reactions: Annotated[dict[Name, Durations], Few] = {}  # reaction times, by name


# A setting is a scalar, a list of scalars, or a table without rows; a row of a table is a setting.
Scalar = bool | int | Number | Text
SettingValue = Scalar | Annotated[tuple[Scalar, ...], Few] | Annotated[dict[Name, Name], Empty]


class Setting(Struct, frozen=True, kw_only=True):
    """One effective setting, as ``info/{service}/config`` has it."""

    value: SettingValue  # a boolean, a number, a text, a list of these, or an empty map
    origin: Text  # a file, a variable of the environment, an option, or ``default``


class Settings(Message, frozen=True, kw_only=True):
    """The effective settings of a service and their sources."""

    settings: Annotated[dict[Name, Setting], Many]  # by path, such as ``vehicle.max_linear``


# --- srv ------------------------------------------------------------------------------------


class SwitchesRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Set the board's emergency brakes; None leaves one as it is."""

    ultrasonic_brake: bool | None = None
    bumper_brake: bool | None = None
    echo: int | None = None  # the newest ``SafetyState.heartbeat`` that the operator's program saw


class LedRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Set one lamp channel; times and speed in the board's own units."""

    channel: Annotated[int, Meta(ge=0, le=255)]
    mode: Annotated[int, Meta(ge=0, le=255)]
    on_lightness: Annotated[int, Meta(ge=0, le=10)] = 10
    on_time: Annotated[int, Meta(ge=0, le=255)] = 0
    off_time: Annotated[int, Meta(ge=0, le=255)] = 0
    flash_lightness: Annotated[int, Meta(ge=0, le=255)] = 0
    speed: Annotated[int, Meta(ge=0, le=255)] = 0
    lightness_min: Annotated[int, Meta(ge=0, le=255)] = 0
    lightness_max: Annotated[int, Meta(ge=0, le=255)] = 0


class ResetRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Clear the causes that the operator saw, and no others."""

    echo: int | None = None  # the newest ``SafetyState.heartbeat`` that the operator's program saw
    causes: Annotated[tuple[int, ...], Few] = ()  # ``Cause.id`` of each


class PoseRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Set the odometry pose in ``odom``."""

    x: Number = 0.0  # m
    y: Number = 0.0  # m
    heading: Number = 0.0  # rad
    echo: int | None = None  # the newest ``SafetyState.heartbeat`` that the operator's program saw


class PlaceRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Say where the standing vehicle is in ``map``, and how well it is known."""

    x: InMap  # m
    y: InMap  # m
    heading: Number  # rad
    sigma: Annotated[float, Meta(ge=0.001, le=100.0)] = 0.1  # m, standard deviation of x and y
    heading_sigma: Annotated[float, Meta(ge=0.001, le=4.0)] = 0.1  # rad
    echo: int | None = None  # the newest ``SafetyState.heartbeat`` that the operator's program saw


class TeachRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Teach a route by driving it, or change the folder of routes."""

    action: TeachAction
    route: RouteName | None = None  # its name, of "begin" and "delete"
    station: StationName = ""  # of "begin" (home) and "station"
    stay: Annotated[float, Meta(ge=0.0, le=86_400.0)] = 0.0  # s, of "begin" and "station"
    points: Route | None = None  # of "save": it replaces the route of its name
    echo: int | None = None  # the newest ``SafetyState.heartbeat`` that the operator's program saw


class PictureRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Return a camera's next picture, as soon as there is one."""

    camera: CameraName
    boot: int = 0  # header of the last one that was received: a newer one is returned
    seq: int = -1
    width: Annotated[int, Meta(ge=16, le=MAX_SIDE)] = MAX_SIDE  # pixels, at most


class RoutesRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """List the routes, or return one."""

    route: RouteName | None = None  # None: list all


class RoutesReply(Struct, frozen=True, kw_only=True):
    """The routes of the folder, or one of them."""

    routes: Annotated[tuple[RouteSummary, ...], Many] = ()
    route: Route | None = None


class RoundRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Start a round, or act on the one that is driven."""

    action: RoundAction
    route: RouteName | None = None  # of "start"
    echo: int | None = None  # the newest ``SafetyState.heartbeat`` that the operator's program saw


class RoundsRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """List the rounds of the ledger, the newest first, or return one with its track."""

    round: Name = ""  # its id; empty: list
    most: Annotated[int, Meta(ge=1, le=1000)] = 50


class RoundsReply(Struct, frozen=True, kw_only=True):
    """Rounds of the ledger, or one with its route and the driven poses."""

    rounds: Annotated[tuple[Round, ...], Many] = ()
    route: Route | None = None
    track: Annotated[tuple[TrackPoint, ...], Meta(max_length=MAX_TRACK)] = ()


class LogRequest(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Read the shift log, the newest rows first."""

    since_ns: int = 0  # wall clock; rows that end before it are left out
    before_ns: int | None = None  # wall clock; only rows that begin before it: the next page
    most: Annotated[int, Meta(ge=1, le=500)] = 200


class LogRow(Struct, frozen=True, kw_only=True):
    """A row of the shift log."""

    kind: LogKind
    robot: Name
    t_ns: int  # wall clock, its begin
    end_ns: int = 0  # wall clock; 0: it has none, or it is not recorded
    level: Level = "info"
    by: Name = ""  # who stopped, took over or asked; empty if that is not recorded
    reset_by: Name = ""
    recording: Name = ""  # the file of the black box
    text: Text
    phrases: Phrases = ()  # the same, for other languages


class LogReply(Struct, frozen=True, kw_only=True):
    """Rows of the shift log, the newest first."""

    rows: Annotated[tuple[LogRow, ...], Many] = ()
    more: bool = False  # whether older rows follow


class Refusal(Struct, frozen=True, kw_only=True):
    """The error reply to a call: why it was not carried out."""

    text: Text
    phrases: Phrases = ()  # the same, for other languages


class Done(Struct, frozen=True, kw_only=True):
    """A call was carried out."""

    text: Text
    phrases: Phrases = ()  # the same, for other languages
    boot: int = 0  # of the answering service; 0 if unknown


class ResetDone(Done, frozen=True, kw_only=True):
    """The answer to a reset; the next states of safety show its effect."""

    heartbeat: int = 0  # the first ``SafetyState.heartbeat`` that shows the effect
    cleared: Annotated[tuple[int, ...], Few] = ()  # ``Cause.id`` of each cause that was cleared
