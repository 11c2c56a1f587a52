"""Sections that two services share: what they refuse."""

import re
from typing import Any, ClassVar

import msgspec
import pytest

from common.settings import (
    Board,
    BusSettings,
    Limits,
    ProtectedSection,
    Robot,
    Section,
    Vehicle,
    Wire,
)


class Guarded(ProtectedSection, frozen=True, kw_only=True):
    """A section with two protections."""

    protective: ClassVar[Limits] = {"margin": (0.05, 10.0), "lease": (0.0, 0.5)}
    margin: float
    lease: float


@pytest.mark.parametrize(
    ("given", "unsafe_overrides"),
    [
        ({"margin": 0.05, "lease": 0.5}, ()),  # both ends are allowed
        ({"margin": 10.0, "lease": 0.0}, ()),
        ({"margin": 0.0, "lease": 0.5}, ("margin",)),
        ({"margin": 0.2, "lease": 0.2}, ("margin",)),  # an override does not help
    ],
)
def test_protections_may_be_kept_or_owned_up_to(
    given: dict[str, float], unsafe_overrides: tuple[str, ...]
) -> None:
    Guarded(**given, unsafe_overrides=unsafe_overrides)


@pytest.mark.parametrize(
    ("margin", "lease", "unsafe_overrides", "sentence"),
    [
        (0.04, 0.5, (), r"margin = 0.04 takes a protection away; allowed is 0.05\.\.10.0"),
        (0.2, 0.51, ("margin",), "lease = 0.51 takes a protection away"),
        (float("nan"), 0.5, (), "margin = nan takes a protection away"),
        (0.2, float("inf"), (), "lease = inf takes a protection away"),
        (0.2, 0.5, ("speed",), "unsafe_overrides names 'speed', which takes no protection away"),
    ],
)
def test_protections_are_not_taken_away_by_accident(
    margin: float, lease: float, unsafe_overrides: tuple[str, ...], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        Guarded(margin=margin, lease=lease, unsafe_overrides=unsafe_overrides)


CERTIFIED: dict[str, Any] = {"ca": "ca.pem", "certificate": "c.pem", "private_key": "c.key"}


@pytest.mark.parametrize(
    "endpoint",
    ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tls/robot.local:7447", "unixsock-stream//run/t2.sock",
     "tcp/127.0.0.1:7447?rel=1", "tcp/127.0.0.1:7447#iface=lo"],
)  # fmt: skip
def test_endpoints_that_zenoh_can_carry(endpoint: str) -> None:
    assert BusSettings(connect=(endpoint,), **CERTIFIED).endpoints == (endpoint,)


@pytest.mark.parametrize(
    "endpoint",
    ["", "tcp", "tcp/", "tcp/127.0.0.1", "127.0.0.1:7447", "http/a:1", "unixsock-stream/"],
)
def test_other_endpoints_are_refused(endpoint: str) -> None:
    with pytest.raises(ValueError, match="should look like tcp/"):
        BusSettings(connect=(endpoint,))
    with pytest.raises(ValueError, match="should look like tcp/"):
        BusSettings(listen=(endpoint,))


def test_a_bus_needs_an_endpoint() -> None:
    with pytest.raises(ValueError, match="one of listen and connect needs an endpoint"):
        BusSettings(listen=(), connect=())


def test_services_dial_the_embedded_router_where_they_can_reach_it() -> None:
    addresses = ("tcp/0.0.0.0:7447", "tcp/[::]:7448", "tcp/10.0.0.1:7449")
    listening = BusSettings(listen=addresses, insecure=True)
    assert listening.endpoints == ("tcp/127.0.0.1:7447", "tcp/[::1]:7448", "tcp/10.0.0.1:7449")


def test_services_on_board_need_no_certificate() -> None:
    socket = "unixsock-stream//run/t2/bus.sock"
    both = BusSettings(listen=("tls/0.0.0.0:7447", socket), members="members.json", **CERTIFIED)
    assert both.endpoints == (socket,)
    alone = BusSettings(listen=("tls/0.0.0.0:7447",), members="members.json", **CERTIFIED)
    assert alone.endpoints == ("tls/127.0.0.1:7447",)


@pytest.mark.parametrize(
    "endpoint", ["tcp/0.0.0.0:1", "tcp/[::]:1", "udp/10.7.5.220:1", "ws/robot.local:1"]
)
def test_a_robot_is_not_opened_to_its_network_by_accident(endpoint: str) -> None:
    with pytest.raises(ValueError, match=r"lets everybody on the network drive; .*--insecure"):
        BusSettings(listen=("tcp/127.0.0.1:7447", endpoint))
    assert BusSettings(listen=(endpoint,), insecure=True).listen == (endpoint,)


@pytest.mark.parametrize(
    "endpoint", ["tcp/127.0.0.1:1", "tcp/127.8.8.8:1", "udp/[::1]:1#iface=lo", "ws/localhost:1",
                 "unixsock-stream//run/t2/bus.sock"],
)  # fmt: skip
def test_what_only_this_machine_reaches_may_be_open(endpoint: str) -> None:
    assert BusSettings(listen=(endpoint,)).listen == (endpoint,)


@pytest.mark.parametrize("name", sorted(CERTIFIED))
@pytest.mark.parametrize("way", ["listen", "connect", "uplink"])
def test_tls_wants_its_files(way: str, name: str) -> None:
    given: dict[str, Any] = {
        way: ("tls/10.7.5.220:7447",),
        "members": "members.json",
        **CERTIFIED,
        name: "",
    }
    with pytest.raises(ValueError, match=rf"^tls/10\.7\.5\.220:7447 wants {name}: a PEM file"):
        BusSettings(**given)


def test_a_router_on_tls_wants_to_know_its_members() -> None:
    with pytest.raises(ValueError, match="wants members: the list of `t2 keys`"):
        BusSettings(listen=("quic/0.0.0.0:7447",), **CERTIFIED)
    BusSettings(connect=("tls/10.7.5.220:7447",), **CERTIFIED)  # a client lets nobody in


@pytest.mark.parametrize("endpoint", ["tcp/192.0.2.1:7447", "udp/[2001:db8::1]:1", "ws/site:1"])
def test_a_robot_is_not_opened_by_what_it_dials(endpoint: str) -> None:
    with pytest.raises(ValueError, match=rf"^uplink {re.escape(endpoint)} lets everybody .*--inse"):
        BusSettings(uplink=(endpoint,))
    with pytest.raises(ValueError, match="lets everybody on the network drive"):
        BusSettings(uplink=(endpoint,), members="members.json")
    assert BusSettings(uplink=(endpoint,), insecure=True).uplink == (endpoint,)
    assert BusSettings(uplink=("tcp/127.0.0.1:7448",)).uplink == ("tcp/127.0.0.1:7448",)


def test_an_uplink_by_tls_wants_to_know_its_members() -> None:
    uplink = ("tls/site.example:7447",)
    with pytest.raises(ValueError, match=r"^tls/site.example:7447 wants members: the list of"):
        BusSettings(uplink=uplink, **CERTIFIED)
    assert BusSettings(uplink=uplink, members="members.json", **CERTIFIED).onboard == ("tcp",)


def test_what_is_dialled_never_passes_for_a_service_on_board() -> None:
    for endpoint in ("tcp/127.0.0.1:7448", "tcp/localhost:7448"):
        with pytest.raises(ValueError, match=r"would pass for a service on board, as .* tcp/, too"):
            BusSettings(uplink=(endpoint,), members="members.json")
    BusSettings(
        uplink=(endpoint,), members="members.json", listen=("unixsock-stream//run/t2/bus.sock",)
    )


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
        ({"listen_address": "fe80::1"}, "listen_address is 'fe80::1': the board needs IPv4"),
        ({"listen_ports": (4002, 4002)}, "names a port twice"),
        ({"port": 4001}, "port 4001 of 127.0.0.1 is both the board's and in listen_ports"),
    ],
)
def test_a_board_that_cannot_be_talked_to_is_refused(
    given: dict[str, object], sentence: str
) -> None:
    with pytest.raises(msgspec.ValidationError, match=sentence):
        msgspec.convert(given, Board)


def test_on_the_vehicle_both_sides_have_the_same_port() -> None:
    assert Board(address="10.7.5.224", port=4002, listen_address="10.7.5.220").port == 4002


@pytest.mark.parametrize("name", ["crc-32", "nonsense", ""])
def test_a_crc_must_be_one_of_16_bits(name: str) -> None:
    with pytest.raises(ValueError, match="crc"):
        Wire(crc=name)


@pytest.mark.parametrize("section", [Robot, BusSettings, Board, Wire, Vehicle])
def test_sections_refuse_what_they_do_not_know(section: type[Section]) -> None:
    with pytest.raises(msgspec.ValidationError, match="unknown field `colour`"):
        msgspec.convert({"colour": "blue"}, section)
