"""Settings sections that several services share; each section is a frozen struct with limits.

The whole configuration of a service is a struct of sections, see ``services/*/config.py``.
"""

import math
import re
from collections.abc import Mapping
from ipaddress import ip_address
from typing import Annotated, ClassVar, Literal, TypeVar

import msgspec
from msgspec import Meta, Struct

T = TypeVar("T", bound=Struct)
Limits = Mapping[str, tuple[float, float]]
Stall = Annotated[float, Meta(ge=0.0, le=1.0)]
AngularUnit = Literal["decidegree", "milliradian"]
LogLevel = Literal["debug", "info", "warning", "error"]

Port = Annotated[int, Meta(ge=1, le=65535)]
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


class ProtectedSection(Section, frozen=True, kw_only=True):
    """A table with settings that can take a protection away.

    Outside of its protective limits a setting makes a protection ineffective. It is refused unless
    ``unsafe_overrides`` names it. Zero never means "off".
    """

    protective: ClassVar[Limits] = {}
    unsafe_overrides: tuple[str, ...] = ()  # settings outside their protective limits, on purpose

    def __post_init__(self) -> None:
        self.check(self.protective, {name: getattr(self, name) for name in self.protective})

    def check(self, limits: Limits, given: Mapping[str, float]) -> None:
        """Raise ``ValueError`` for a value outside its limits, and for an unknown override."""
        unknown = sorted(set(self.unsafe_overrides) - set(limits))
        if unknown:
            raise ValueError(
                f"unsafe_overrides names {unknown[0]!r}, which takes no protection away"
            )
        for name, (low, high) in limits.items():
            if not low <= given[name] <= high and name not in self.unsafe_overrides:
                raise ValueError(
                    f"{name} = {given[name]} takes a protection away; "
                    f"allowed is {low}..{high}, or name it in unsafe_overrides"
                )


def lengthened(limits: T, stall_s: float) -> T:
    """Return time limits (s) for a computer whose processes stall for this long.

    An age, a lease or a silence may span a stall of the sender, of the receiver, and of the host.
    """
    longer = {name: value + 3 * stall_s for name, value in msgspec.structs.asdict(limits).items()}
    return type(limits)(**longer)


class Robot(Section, frozen=True, kw_only=True):
    """Identity of the robot, and scheduling of its processes."""

    id: Name = "001"
    realtime: bool = True  # whether the control chain requests SCHED_FIFO


class BusSettings(ProtectedSection, frozen=True, kw_only=True):
    """Zenoh router, endpoints and certificates."""

    protective: ClassVar[Limits] = {"lease": (0.0, 2.0)}
    listen: tuple[str, ...] = ("tcp/127.0.0.1:7447",)  # the embedded router's endpoints
    # where services connect, bridge and safety to one router only; empty means ``listen``
    connect: tuple[str, ...] = ()
    uplink: tuple[str, ...] = ()  # the site's router, to which the robot's router connects
    # the drive link between bridge and safety, unixsock-stream/PATH; empty means derived.
    drive: str = ""
    lease: Annotated[float, Meta(ge=0.2, le=10.0)] = 1.0  # s until a silent partition is detected
    # s for the router's answer to its probe: a router that misses it twice is restarted.
    probe_deadline: Annotated[float, Meta(ge=0.5, le=60.0)] = 1.0
    ca: str = ""  # PEM files of `t2 keys`, for tls/ endpoints
    certificate: str = ""
    private_key: str = ""
    members: str = ""  # member list of `t2 keys`: accepted certificates and roles
    insecure: bool = False  # allow network endpoints without TLS
    laptop_rate: Annotated[float, Meta(ge=1.0, le=1000.0)] = 10.0  # Hz of each stream to a laptop

    def __post_init__(self) -> None:
        super().__post_init__()
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


class Board(ProtectedSection, frozen=True, kw_only=True):
    """Addresses of the vehicle's main board and of this computer (manual 1)."""

    protective: ClassVar[Limits] = {"any_source_port": (False, False)}
    address: str = "127.0.0.1"  # 10.7.5.224 on the vehicle
    port: Port = 4003  # 4002 on the vehicle; on one host it must differ from ours
    listen_address: str = "127.0.0.1"  # 10.7.5.220 on the vehicle
    # the board sends to both; commands leave from the port that receives the velocity
    listen_ports: Annotated[tuple[Port, ...], Meta(min_length=1, max_length=2)] = (4002, 4001)
    any_source_port: bool = False  # accept frames from every port of the board's address
    # UDP port at ``address`` that a relay reports from, 4010; 0: no relay (docs/relay.md).
    relay_port: Annotated[int, Meta(ge=0, le=65535)] = 0

    def __post_init__(self) -> None:
        super().__post_init__()
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


class Place(Section, frozen=True, kw_only=True):
    """Position (m) and direction (rad) of a sonar in ``base_link``."""

    x: float
    y: float
    yaw: Annotated[float, Meta(ge=-3.2, le=3.2)]


class Vehicle(Section, frozen=True, kw_only=True):
    """Dimensions of the vehicle; the manual gives none, so measure yours.

    The origin of ``base_link`` is the middle of the wheels, on the ground.
    """

    length: Annotated[float, Meta(ge=0.2, le=5.0)] = 1.10  # m, bumper to bumper
    width: Annotated[float, Meta(ge=0.2, le=3.0)] = 0.70  # m
    wheelbase: Annotated[float, Meta(ge=0.1, le=5.0)] = 0.70  # m, front axle to rear axle
    track: Annotated[float, Meta(ge=0.1, le=3.0)] = 0.56  # m, left wheels to right wheels
    sonar_min: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.05  # m, nearer cannot be measured
    sonar_max: Annotated[float, Meta(ge=0.5, le=20.0)] = 5.0  # m, farther gives no echo
    # where a sonar is, if not on the hull: front = { x = 0.5, y = 0.0, yaw = 0.0 }, m and rad
    sonars: dict[str, Place] = msgspec.field(default_factory=dict)

    def __post_init__(self) -> None:
        usual = {mount.name: mount for mount in _on_the_hull(self)}
        if unknown := sorted(self.sonars.keys() - usual):
            raise ValueError(f"sonars names {unknown[0]!r}, allowed are {', '.join(usual)}")
        for mount in sonar_mounts(self):
            _check_place(mount, usual[mount.name], self)


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

    robot: Robot = Robot()
    bus: BusSettings = BusSettings()
    log: Log = Log()
