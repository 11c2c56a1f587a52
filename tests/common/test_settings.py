"""Sections that two services share: what they refuse."""

import msgspec
import pytest

from common.settings import Board, Bus, Robot, Section, Vehicle, Wire, check_protections

LIMITS = {"margin": (0.05, 10.0), "lease": (0.0, 0.5)}


@pytest.mark.parametrize(
    ("given", "i_accept"),
    [
        ({"margin": 0.05, "lease": 0.5}, ()),  # both ends are allowed
        ({"margin": 10.0, "lease": 0.0}, ()),
        ({"margin": 0.0, "lease": 0.5}, ("margin",)),
        ({"margin": 0.2, "lease": 0.2}, ("margin",)),  # owned up to in vain
    ],
)
def test_protections_may_be_kept_or_owned_up_to(
    given: dict[str, float], i_accept: tuple[str, ...]
) -> None:
    check_protections(given, LIMITS, i_accept)


@pytest.mark.parametrize(
    ("margin", "lease", "i_accept", "sentence"),
    [
        (0.04, 0.5, (), r"margin = 0.04 takes a protection away; allowed is 0.05\.\.10.0"),
        (0.2, 0.51, ("margin",), "lease = 0.51 takes a protection away"),
        (float("nan"), 0.5, (), "margin = nan takes a protection away"),
        (0.2, float("inf"), (), "lease = inf takes a protection away"),
        (0.2, 0.5, ("speed",), "i_accept names 'speed', which takes no protection away"),
    ],
)
def test_protections_are_not_taken_away_by_accident(
    margin: float, lease: float, i_accept: tuple[str, ...], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        check_protections({"margin": margin, "lease": lease}, LIMITS, i_accept)


@pytest.mark.parametrize(
    "endpoint",
    ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tls/robot.local:7447", "unixsock-stream//run/t2.sock",
     "tcp/127.0.0.1:7447?rel=1", "tcp/127.0.0.1:7447#iface=lo"],
)  # fmt: skip
def test_endpoints_that_zenoh_can_carry(endpoint: str) -> None:
    assert Bus(connect=(endpoint,)).endpoints == (endpoint,)


@pytest.mark.parametrize(
    "endpoint",
    ["", "tcp", "tcp/", "tcp/127.0.0.1", "127.0.0.1:7447", "http/a:1", "unixsock-stream/"],
)
def test_other_endpoints_are_refused(endpoint: str) -> None:
    with pytest.raises(ValueError, match="should look like tcp/"):
        Bus(connect=(endpoint,))
    with pytest.raises(ValueError, match="should look like tcp/"):
        Bus(listen=(endpoint,))


def test_a_bus_needs_an_endpoint() -> None:
    with pytest.raises(ValueError, match="one of listen and connect needs an endpoint"):
        Bus(listen=(), connect=())


def test_services_dial_the_embedded_router_where_they_can_reach_it() -> None:
    listening = Bus(listen=("tcp/0.0.0.0:7447", "tcp/[::]:7448", "tcp/10.0.0.1:7449"))
    assert listening.endpoints == ("tcp/127.0.0.1:7447", "tcp/[::1]:7448", "tcp/10.0.0.1:7449")


@pytest.mark.parametrize("name", ["", "a/b", "*", "$*", "a b", "001\n", "@x", "a?b", "a#b"])
def test_a_robots_id_is_one_plain_chunk_of_a_key(name: str) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert({"id": name}, Robot)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"address": "robot"}, "address is 'robot', allowed is an IP address"),
        ({"listen_address": ""}, "listen_address is '', allowed is an IP address"),
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


@pytest.mark.parametrize("section", [Robot, Bus, Board, Wire, Vehicle])
def test_sections_refuse_what_they_do_not_know(section: type[Section]) -> None:
    with pytest.raises(msgspec.ValidationError, match="unknown field `colour`"):
        msgspec.convert({"colour": "blue"}, section)
