"""Sections that several services share: what they allow and refuse; the places of sonars."""

import math
from typing import Annotated, Any

import msgspec
import pytest

from common.settings import (
    Board,
    BusSettings,
    Robot,
    Safe,
    Section,
    Vehicle,
    allowed,
    recess,
    sonar_mounts,
)
from t2.messages import SONAR_NAMES


class Part(Section, frozen=True, kw_only=True):
    """A row of a table."""

    lease: Annotated[float, allowed("s", gt=0.0, le=10.0, safe=(0.0, 0.5))]


class Guarded(Section, frozen=True, kw_only=True):
    """A section with protections."""

    margin: Annotated[float, allowed("m", safe=(0.05, 10.0))] = 0.2
    brakes: Annotated[bool, allowed(safe=(True, True))] = True
    title: Annotated[str, msgspec.Meta(max_length=5)] = ""
    length: Annotated[float, allowed("m", ge=0.0)] = 1.0
    parts: dict[str, Part] = msgspec.field(default_factory=dict)


def test_the_safe_values_are_part_of_the_types() -> None:
    part = Safe(0.0, 0.5, "s")
    assert Guarded(parts={"a": Part(lease=0.1), "b": Part(lease=9.0)}).protections() == {
        "margin": Safe(0.05, 10.0, "m"),
        "brakes": Safe(True, True),
        "parts.a.lease": part,
        "parts.b.lease": part,
    }
    assert (str(part), str(Safe(True, True))) == ("0.0..0.5 s", "True")


@pytest.mark.parametrize(
    "given",
    [
        {"gears_linear": [0.2, 0.3]},
        {"gears_angular": [0.5, 0.4, 0.6, 0.7, 0.8]},
        {"gears_linear": [0.0, 0.3, 0.4, 0.5, 0.6]},
    ],
)
def test_gears_are_five_rising_speeds(given: dict[str, Any]) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(given, Vehicle)


# --- the bus ------------------------------------------------------------------------------------

TLS: dict[str, Any] = {"ca": "ca.pem", "certificate": "c.pem", "private_key": "c.key"}
LIKE, OPEN = "should look like tcp/", r"lets everybody on the network drive; .*--insecure"
MEMBERS, PASS = "wants members: the list of `t2 keys`", r"would pass for a service on board, as"
SOCKET, LIST = "unixsock-stream//run/t2.sock", "members.json"


@pytest.mark.parametrize(
    ("given", "refusal"),
    [
        *(
            ({way: (endpoint,)}, LIKE)
            for endpoint in ("", "tcp", "tcp/", "tcp/127.0.0.1", "127.0.0.1:7447", "http/a:1")
            for way in ("listen", "connect")
        ),
        *(
            ({"connect": (endpoint,), **TLS}, "")
            for endpoint in ("tcp/[::1]:7447", "tls/robot.local:7447", SOCKET,
                             "tcp/127.0.0.1:7447?rel=1", "tcp/127.0.0.1:7447#iface=lo")
        ),
        ({"listen": ()}, "one of listen and connect needs an endpoint"),
        # What other hosts can reach.
        *(
            ({way: (endpoint,)}, OPEN)
            for endpoint in ("tcp/0.0.0.0:1", "udp/[::]:1", "tcp/192.0.2.1:1", "ws/robot.local:1")
            for way in ("listen", "uplink")
        ),
        ({"listen": ("tcp/0.0.0.0:1",), "insecure": True}, ""),
        *(
            ({"listen": (endpoint,)}, "")
            for endpoint in ("tcp/127.8.8.8:1", "udp/[::1]:1#iface=lo", "ws/localhost:1", SOCKET)
        ),
        ({"uplink": ("tcp/127.0.0.1:7448",)}, ""),
        ({"uplink": ("tcp/127.0.0.1:7448",), "members": LIST}, PASS),
        ({"uplink": ("tcp/localhost:7448",), "members": LIST}, PASS),
        ({"uplink": ("tcp/127.0.0.1:7448",), "members": LIST, "listen": (SOCKET,)}, ""),
        # What needs certificates and members.
        *(
            ({way: ("tls/a:1",), "members": LIST, **TLS, name: ""}, f"^tls/a:1 wants {name}: a PEM")
            for way in ("listen", "connect", "uplink")
            for name in TLS
        ),
        ({"listen": ("quic/0.0.0.0:7447",), **TLS}, MEMBERS),
        ({"uplink": ("tls/site.example:7447",), **TLS}, MEMBERS),
        ({"uplink": ("tls/site.example:7447",), "members": LIST, **TLS}, ""),
        ({"connect": ("tls/10.7.5.220:7447",), **TLS}, ""),  # a client accepts no connections
    ],
)  # fmt: skip
def test_endpoints_of_the_bus(given: dict[str, Any], refusal: str) -> None:
    if not refusal:
        BusSettings(**given)
        return
    with pytest.raises(ValueError, match=refusal):
        BusSettings(**given)


@pytest.mark.parametrize(
    ("listen", "endpoints", "onboard"),
    [
        (("tcp/0.0.0.0:7447", "tcp/[::]:7448"), ("tcp/127.0.0.1:7447", "tcp/[::1]:7448"), ("tcp",)),
        (("tls/0.0.0.0:7447", SOCKET), (SOCKET,), ("unixsock-stream",)),
        (("tls/0.0.0.0:7447",), ("tls/127.0.0.1:7447",), ()),
    ],
)
def test_services_connect_to_the_embedded_router_without_tls_if_they_can(
    listen: tuple[str, ...], endpoints: tuple[str, ...], onboard: tuple[str, ...]
) -> None:
    where = BusSettings(listen=listen, members=LIST, insecure=True, **TLS)
    assert (where.endpoints, where.onboard) == (endpoints, onboard)


# --- the other sections -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["", "a/b", "*", "$*", "a b", "001\n", "@x", "a?b", "a#b"])
def test_a_robots_id_is_one_plain_chunk_of_a_key(name: str) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert({"id": name}, Robot)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"address": "robot"}, "address is 'robot', allowed is an IPv4 address"),
        ({"listen_address": ""}, "listen_address is '', allowed is an IPv4 address"),
        ({"address": "::1"}, "address is '::1': the board needs IPv4, allowed is an IPv4 address"),
        ({"listen_ports": (4002, 4002)}, "names a port twice"),
        ({"port": 4001}, "port 4001 of 127.0.0.1 is both the board's and in listen_ports"),
        ({"relay_port": 4003}, "relay_port is 4003, as port: the relay reports from another"),
        ({"relay_port": 65536}, "relay_port"),
    ],
)
def test_a_board_that_cannot_be_reached_is_refused(given: dict[str, object], sentence: str) -> None:
    with pytest.raises(msgspec.ValidationError, match=sentence):
        msgspec.convert(given, Board)


def test_sonars_are_on_the_edge_clockwise_from_the_left_and_look_outward() -> None:
    mounts = sonar_mounts(Vehicle(length=2.0, width=1.0))
    assert tuple(mount.name for mount in mounts) == SONAR_NAMES
    degrees = [round(math.degrees(mount.yaw)) for mount in mounts]
    assert degrees == [90, 45, 0, -45, -90, -135, 180, 135]
    for mount in mounts:
        assert abs(mount.x) == 1.0 or abs(mount.y) == 0.5
        assert mount.x * math.cos(mount.yaw) + mount.y * math.sin(mount.yaw) > 0
        assert ("left" in mount.name) == (mount.y > 0)
        assert ("front" in mount.name) == (mount.x > 0)
        assert recess(mount, Vehicle(length=2.0, width=1.0)) == 0.0


def place(name: str, x: float, y: float, degrees: float = 0.0) -> dict[str, object]:
    return {"sonars": {name: {"x": x, "y": y, "yaw": math.radians(degrees)}}}


@pytest.mark.parametrize(
    ("given", "depth"),
    [
        (place("front", 0.50, 0.1), 0.05),
        (place("front", 0.45, 0.0, 8), 0.1 / math.cos(math.radians(8))),
        (place("left", 0.1, 0.25, 90), 0.1),
        (place("rear_right", -0.55, -0.25, -135), 0.0),  # on the end, looking past it
        (place("rear_left", -0.50, 0.25, 135), 0.05 * math.sqrt(2)),
    ],
)
def test_a_sonar_in_the_hull_has_no_room_up_to_it(given: dict[str, object], depth: float) -> None:
    vehicle = msgspec.convert(given, Vehicle)
    mounts = {mount.name: mount for mount in sonar_mounts(vehicle)}
    assert tuple(mounts) == SONAR_NAMES
    (name,) = vehicle.sonars
    assert recess(mounts.pop(name), vehicle) == pytest.approx(depth, abs=1e-9)
    assert tuple(mounts.values()) == tuple(m for m in sonar_mounts(Vehicle()) if m.name != name)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (place("nose", 0.5, 0.0), "sonars names 'nose', allowed are left, front_left, front,"),
        (place("front", 0.56, 0.0), r"sonars.front is at \(0.56, 0\), allowed are places in the"),
        (place("front", 0.24, 0.0), r"at most 0.3 m from \(0.55, 0\)"),
        (place("front", 0.5, math.nan), "sonars.front is at"),
        (
            place("front", 0.5, 0.0, 9),
            "sonars.front.yaw is 0.15708, allowed is -0.15 to 0.15 rad",
        ),
        (place("rear", -0.5, 0.0), "sonars.rear.yaw"),
        (place("rear", -0.5, 0.0, math.nan), "yaw"),
        (place("rear", -0.5, 0.0, math.inf), "yaw"),
    ],
)
def test_a_sonar_must_see_what_its_name_says(given: dict[str, object], sentence: str) -> None:
    with pytest.raises(msgspec.ValidationError, match=sentence):
        msgspec.convert(given, Vehicle)
