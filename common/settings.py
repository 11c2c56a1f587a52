"""Settings sections that several services share; each section is a frozen struct with limits.

The whole configuration of a service is a struct of sections, see ``services/*/config.py``.
"""

import math
import re
from collections.abc import Mapping
from ipaddress import ip_address
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, get_type_hints

import msgspec
from msgspec import Meta, Struct

T = TypeVar("T", bound=Struct)


class Safe(NamedTuple):
    """Lowest and highest value that take no protection away, with their unit."""

    low: float
    high: float
    unit: str = ""

    def __str__(self) -> str:
        bounds = f"{self.low}" if self.low == self.high else f"{self.low}..{self.high}"
        return f"{bounds} {self.unit}".rstrip()


def allowed(unit: str = "", *, safe: tuple[float, float] | None = None, **bounds: float) -> Meta:
    """Return unit and bounds (``gt``, ``ge``, ``le``) of a number, for its type.

    Outside of ``safe`` a setting makes a protection ineffective: it is refused unless
    ``unsafe_overrides`` names its path. Zero never means "off".
    """
    of_type: Any = {**bounds, "extra": {"unit": unit, "safe": safe and Safe(*safe, unit)}}
    return Meta(**of_type)


def extra_of(kind: object) -> Mapping[str, Any]:
    """Return what ``allowed`` has put into a type: ``unit`` and ``safe``; nothing otherwise."""
    parts = [part.extra for part in getattr(kind, "__metadata__", ()) if isinstance(part, Meta)]
    return next(filter(None, parts), {})


AngularUnit = Literal["decidegree", "milliradian"]
LogLevel = Literal["debug", "info", "warning", "error"]

Port = Annotated[int, Meta(ge=1, le=65535)]
MetresPerSecond = Annotated[float, allowed("m/s", gt=0.0, le=3.0)]
RadiansPerSecond = Annotated[float, allowed("rad/s", gt=0.0, le=3.0)]
# A robot's id, and other parts of a certificate's name: one chunk of a key.
Name = Annotated[str, Meta(pattern=r"^[A-Za-z0-9_.-]{1,60}\Z")]
# The name of a source, as in ``safety.sources`` and ``safety.limits``.
SourceName = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_-]{0,31}\Z")]

# Protocols of the eclipse-zenoh wheel; a client would retry any other one forever.
ENDPOINT = re.compile(r"((tcp|udp|tls|quic|ws)/.+:\d+|unixsock-stream/.+)([?#].*)?")
ENCRYPTED = ("tls/", "quic/")
SOCKET_BYTES = 107  # of the path of a Unix socket, on Linux


class Section(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One table of the configuration file."""

    def protections(self) -> dict[str, Safe]:
        """Return the safe values of each setting that has such, by its path in this table."""
        found = {}
        for name, kind in get_type_hints(type(self), include_extras=True).items():
            value = getattr(self, name)
            if safe := extra_of(kind).get("safe"):
                found[name] = safe
            for row, section in value.items() if isinstance(value, dict) else ():
                if isinstance(section, Section):
                    of_row = section.protections()
                    found |= {f"{name}.{row}.{at}": it for at, it in of_row.items()}
        return found


def lengthened(limits: T, stall_s: float) -> T:
    """Return time limits (s) for a computer whose processes stall for this long.

    An age, a lease or a silence may span a stall of the sender, of the receiver, and of the host.
    """
    longer = {name: value + 3 * stall_s for name, value in msgspec.structs.asdict(limits).items()}
    return type(limits)(**longer)


class Robot(Section, frozen=True, kw_only=True):
    """Identity of the robot."""

    id: Name = "001"


class Host(Section, frozen=True, kw_only=True):
    """The computer that the services run on."""

    # its processes stall for so long: every time limit of bridge and safety is longer
    stall: Annotated[float, allowed("s", ge=0.0, le=1.0, safe=(0.0, 0.0))] = 0.0
    realtime: bool = True  # whether the control chain requests SCHED_FIFO


class BusSettings(Section, frozen=True, kw_only=True):
    """Zenoh router, endpoints and certificates."""

    listen: tuple[str, ...] = ("tcp/127.0.0.1:7447",)  # the embedded router's endpoints
    # where services connect, bridge and safety to one router only; empty means ``listen``
    connect: tuple[str, ...] = ()
    uplink: tuple[str, ...] = ()  # the site's router, to which the robot's router connects
    # the drive link between bridge and safety, unixsock-stream/PATH; empty means derived.
    drive: str = ""
    # until a silent partition is detected
    lease: Annotated[float, allowed("s", ge=0.2, le=10.0, safe=(0.2, 2.0))] = 1.0
    # for the router's answer to its probe: a router that misses it twice is restarted
    probe_deadline: Annotated[float, allowed("s", ge=0.5, le=60.0)] = 1.0
    ca: str = ""  # PEM files of `t2 keys`, for tls/ endpoints
    certificate: str = ""
    private_key: str = ""
    members: str = ""  # member list of `t2 keys`: accepted certificates and roles
    insecure: bool = False  # allow network endpoints without TLS
    laptop_rate: Annotated[float, allowed("Hz", ge=1.0, le=1000.0)] = 10.0  # of each stream

    def __post_init__(self) -> None:
        for endpoint in (*self.listen, *self.connect, *self.uplink):
            if not ENDPOINT.fullmatch(endpoint):
                raise ValueError(f"endpoint {endpoint!r} should look like tcp/127.0.0.1:7447")
        if not (self.listen or self.connect):
            raise ValueError("one of listen and connect needs an endpoint")
        if self.drive:
            drive_path(self.drive)
        self._check_open()
        self._check_encrypted()

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Endpoints for clients: ``connect``, or else the embedded router's, without TLS first."""
        plain = tuple(endpoint for endpoint in self.listen if not is_encrypted(endpoint))
        return self.connect or tuple(
            endpoint.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")
            for endpoint in plain or self.listen
        )

    @property
    def onboard(self) -> tuple[str, ...]:
        """Protocols that the router listens on without TLS, and trusts."""
        plain = (each for each in self.listen if not is_encrypted(each))
        return tuple(sorted({protocol(each) for each in plain}))

    def _check_open(self) -> None:
        """Refuse network endpoints without TLS, unless ``insecure`` is set."""
        if self.insecure:
            return
        for way, endpoints in (("listen", self.listen), ("uplink", self.uplink)):
            for endpoint in endpoints:
                if not (is_encrypted(endpoint) or is_local(endpoint)):
                    raise ValueError(
                        f"{way} {endpoint} lets everybody on the network drive; use tls/... with "
                        "`t2 keys` to accept named members only, or --insecure to accept all"
                    )
        for endpoint in self.uplink if self.members else ():
            # Access rules identify a link by its protocol alone.
            if protocol(endpoint) in self.onboard:
                raise ValueError(
                    f"uplink {endpoint} would pass for a service on board, as listen has "
                    f"{protocol(endpoint)}/, too; use tls/... or listen on unixsock-stream/..."
                )

    def _check_encrypted(self) -> None:
        """Refuse TLS endpoints without certificate files."""
        encrypted = [e for e in (*self.listen, *self.connect, *self.uplink) if is_encrypted(e)]
        for name in ("ca", "certificate", "private_key"):
            if encrypted and not getattr(self, name):
                raise ValueError(f"{encrypted[0]} wants {name}: a PEM file of `t2 keys issue`")
        for endpoint in (*self.listen, *self.uplink):
            if is_encrypted(endpoint) and not self.members:
                raise ValueError(
                    f"{endpoint} wants members: the list of `t2 keys`, without it every client "
                    "has all permissions"
                )


def protocol(endpoint: str) -> str:
    """Return the protocol of an endpoint, such as tcp."""
    return endpoint.partition("/")[0]


def drive_path(endpoint: str) -> str:
    """Return the path in the drive link's endpoint; raise ``ValueError`` if it is invalid."""
    kind, _, path = endpoint.partition("/")
    if kind != "unixsock-stream" or not path.startswith("/") or set(path) & set("?#"):
        raise ValueError(
            f"drive {endpoint!r} should look like unixsock-stream//run/t2-drive/drive.sock"
        )
    length = len(path.encode())
    if length > SOCKET_BYTES:
        raise ValueError(
            f"drive: the path of a Unix socket has at most {SOCKET_BYTES} bytes, "
            f"{path} has {length}"
        )
    return path


def is_encrypted(endpoint: str) -> bool:
    """Return whether an endpoint uses TLS."""
    return endpoint.startswith(ENCRYPTED)


def is_local(endpoint: str) -> bool:
    """Return whether only this host can reach an endpoint."""
    if protocol(endpoint) == "unixsock-stream":
        return True
    address = endpoint.partition("/")[2]
    host = address.partition("?")[0].partition("#")[0].rpartition(":")[0].strip("[]")
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class Board(Section, frozen=True, kw_only=True):
    """The vehicle's main board: addresses (manual 1), and what it must confirm."""

    address: str = "127.0.0.1"  # 10.7.5.224 on the vehicle
    port: Port = 4003  # 4002 on the vehicle; on one host it must differ from ours
    listen_address: str = "127.0.0.1"  # 10.7.5.220 on the vehicle
    # the board sends to both; commands leave from the port that receives the velocity
    listen_ports: Annotated[tuple[Port, ...], Meta(min_length=1, max_length=2)] = (4002, 4001)
    # accept frames from every port of the board's address
    any_source_port: Annotated[bool, allowed(safe=(False, False))] = False
    # UDP port at ``address`` that a relay reports from, 4010; 0: no relay (docs/relay.md).
    relay_port: Annotated[int, Meta(ge=0, le=65535)] = 0
    # it must confirm that its own emergency brakes are on, before anything drives
    require_switches: Annotated[bool, allowed(safe=(True, True))] = True

    def __post_init__(self) -> None:
        for name in ("address", "listen_address"):
            _check_ipv4(name, getattr(self, name))
        if len(set(self.listen_ports)) < len(self.listen_ports):
            raise ValueError(f"listen_ports {self.listen_ports} names a port twice")
        if self.relay_port == self.port:
            raise ValueError(f"relay_port is {self.port}, as port: the relay reports from another")
        if self.address == self.listen_address and self.port in self.listen_ports:
            raise ValueError(
                f"port {self.port} of {self.address} is both the board's and in listen_ports"
            )


def _check_ipv4(name: str, value: str) -> None:
    try:
        version = ip_address(value).version
    except ValueError:
        raise ValueError(f"{name} is {value!r}, allowed is an IPv4 address") from None
    if version != 4:
        raise ValueError(f"{name} is {value!r}: the board needs IPv4, allowed is an IPv4 address")


class Wire(Section, frozen=True, kw_only=True):
    """Frame details that the manual does not define; the defaults are the current answers."""

    command_angular_unit: AngularUnit = "decidegree"  # per second, of motion commands
    feedback_angular_unit: AngularUnit = "decidegree"  # per second, of measured velocities


class Log(Section, frozen=True, kw_only=True):
    """Log output on standard error."""

    level: LogLevel = "info"
    format: Literal["auto", "text", "json"] = "auto"  # auto: text on a terminal, JSON otherwise


# What a sonar's name says must stay seen, and a wall alongside must be known as one.
MAX_SHIFT_M, MAX_AVERT = 0.3, 0.15  # m, rad from the usual place
GEARS = 5


class Place(Section, frozen=True, kw_only=True):
    """Position and direction of a sonar in ``base_link``."""

    x: Annotated[float, allowed("m")]
    y: Annotated[float, allowed("m")]
    yaw: Annotated[float, allowed("rad", ge=-3.2, le=3.2)]


class Vehicle(Section, frozen=True, kw_only=True):
    """What the vehicle is, can do and may do; the manual gives no dimensions: measure yours.

    The origin of ``base_link`` is the middle of the wheels, on the ground.
    """

    length: Annotated[float, allowed("m", ge=0.2, le=5.0)] = 1.10  # bumper to bumper
    width: Annotated[float, allowed("m", ge=0.2, le=3.0)] = 0.70
    track: Annotated[float, allowed("m", ge=0.1, le=3.0)] = 0.56  # left wheels to right wheels
    sonar_min: Annotated[float, allowed("m", ge=0.0, le=1.0)] = 0.05  # nearer cannot be measured
    sonar_max: Annotated[float, allowed("m", ge=0.5, le=20.0)] = 5.0  # farther gives no echo
    # where a sonar is, if not on the hull: front = { x = 0.5, y = 0.0, yaw = 0.0 }, m and rad
    sonars: dict[str, Place] = msgspec.field(default_factory=dict)
    max_linear: Annotated[float, allowed("m/s", ge=0.05, le=3.0, safe=(0.05, 1.5))] = 1.0
    max_angular: Annotated[float, allowed("rad/s", ge=0.05, le=3.0, safe=(0.05, 2.0))] = 1.0
    # guaranteed: safety slows down by it, and a STOP that does not reach it becomes BRAKE sooner
    deceleration: Annotated[float, allowed("m/s^2", gt=0.0, le=10.0, safe=(0.1, 1.0))] = 0.6
    # likewise
    angular_deceleration: Annotated[float, allowed("rad/s^2", gt=0.0, le=10.0, safe=(0.1, 3.0))] = (
        1.0
    )
    gears_linear: tuple[MetresPerSecond, ...] = (0.2, 0.35, 0.5, 0.65, 0.8)  # of operators
    gears_angular: tuple[RadiansPerSecond, ...] = (0.3, 0.45, 0.6, 0.75, 0.9)

    def __post_init__(self) -> None:
        usual = {mount.name: mount for mount in _on_the_hull(self)}
        if unknown := sorted(self.sonars.keys() - usual):
            raise ValueError(f"sonars names {unknown[0]!r}, allowed are {', '.join(usual)}")
        for mount in sonar_mounts(self):
            _check_place(mount, usual[mount.name], self)
        for name in ("gears_linear", "gears_angular"):
            gears = getattr(self, name)
            if len(gears) != GEARS or list(gears) != sorted(gears):
                raise ValueError(f"{name} {list(gears)} should be {GEARS} rising speeds")


class Mount(Struct, frozen=True):
    """Position (m) and direction of a sonar in ``base_link``: x forward, y left."""

    name: str
    x: float
    y: float
    yaw: float  # rad, counter-clockwise from straight ahead


def sonar_mounts(vehicle: Vehicle) -> tuple[Mount, ...]:
    """Return the eight sonars in the manual's order, clockwise from the left (manual 2.3)."""
    return tuple(
        Mount(usual.name, place.x, place.y, place.yaw)
        if (place := vehicle.sonars.get(usual.name))
        else usual
        for usual in _on_the_hull(vehicle)
    )


def recess(mount: Mount, vehicle: Vehicle) -> float:
    """Return the distance (m) from a sonar along its axis to the hull: no room is there."""
    axis = math.cos(mount.yaw), math.sin(mount.yaw)
    sides = (vehicle.length / 2, mount.x, axis[0]), (vehicle.width / 2, mount.y, axis[1])
    return min((math.copysign(half, way) - at) / way for half, at, way in sides if way)


def _check_place(mount: Mount, usual: Mount, vehicle: Vehicle) -> None:
    is_inside = abs(mount.x) <= vehicle.length / 2 and abs(mount.y) <= vehicle.width / 2
    if not is_inside or math.dist((mount.x, mount.y), (usual.x, usual.y)) > MAX_SHIFT_M:
        raise ValueError(
            f"sonars.{mount.name} is at ({mount.x:g}, {mount.y:g}), allowed are places in the hull "
            f"(length, width) at most {MAX_SHIFT_M:g} m from ({usual.x:g}, {usual.y:g})"
        )
    if not math.cos(mount.yaw - usual.yaw) >= math.cos(MAX_AVERT):
        raise ValueError(
            f"sonars.{mount.name}.yaw is {mount.yaw:g}, allowed is {usual.yaw - MAX_AVERT:.2f} to "
            f"{usual.yaw + MAX_AVERT:.2f} rad"
        )


def _on_the_hull(vehicle: Vehicle) -> tuple[Mount, ...]:
    front, left = vehicle.length / 2, vehicle.width / 2
    degrees = math.radians
    return (
        Mount("left", 0.0, left, degrees(90)),
        Mount("front_left", front, left, degrees(45)),
        Mount("front", front, 0.0, 0.0),
        Mount("front_right", front, -left, degrees(-45)),
        Mount("right", 0.0, -left, degrees(-90)),
        Mount("rear_right", -front, -left, degrees(-135)),
        Mount("rear", -front, 0.0, degrees(180)),
        Mount("rear_left", -front, left, degrees(135)),
    )


class Shared(Struct, frozen=True, kw_only=True):
    """Sections of every service; a service's own configuration extends them."""

    # paths of settings that take a protection away, on purpose, such as "safety.margin"
    unsafe_overrides: tuple[str, ...] = ()
    robot: Robot = Robot()
    host: Host = Host()
    bus: BusSettings = BusSettings()
    log: Log = Log()
