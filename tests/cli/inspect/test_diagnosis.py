"""From what was seen to findings: laptop to services."""

import pytest

from cli.inspect import remedies
from cli.inspect.diagnosis import (
    Dial,
    Finding,
    Seen,
    clock,
    network,
    on_the_way,
    rights,
    router,
    services,
    versions,
)
from tests.cli.inspect.tool import health

THREE = ("bridge", "safety", "odom")


def seen(**given: object) -> Seen:
    """Return a robot that is well, but for what is given."""
    well: dict[str, object] = {
        "zenoh": "1.10.2", "t2": "1", "routers": ["1.10.2"],
        "instances": dict.fromkeys(THREE, 1), "may_drive": True, "may_call": True,
        "health": {name: health(name) for name in THREE}, "delays_s": [0.01, 0.02],
        "rates": {"tel/bridge/bumper": 50.0},
    }  # fmt: skip
    return Seen(**(well | given))  # type: ignore[arg-type]


def levels(found: list[Finding]) -> set[str]:
    return {each.level for each in found}


def test_all_is_well() -> None:
    assert levels(list(on_the_way(seen()))) == {"ok"}


@pytest.mark.parametrize(
    ("dials", "expected"),
    [
        ([Dial("tcp/a:1", seconds=0.001)], ["ok"]),
        ([Dial("tcp/a:1", "silence", "move")], ["wrong"]),
        ([Dial("tcp/a:1", "silence", "move"), Dial("tcp/b:1")], ["note", "ok"]),
        ([Dial("udp/a:1", tried=False)], ["unknown"]),
    ],
)
def test_one_endpoint_that_answers_will_do(dials: list[Dial], expected: list[str]) -> None:
    found = list(network(dials))
    assert [each.level for each in found] == expected
    assert all(dial.endpoint in each.text for dial, each in zip(dials, found, strict=True))


def test_what_to_do_about_the_network_is_said() -> None:
    (found,) = network([Dial("tcp/a:1", "silence", "move")])
    assert (found.text, found.todo) == ("tcp/a:1: silence", "move")


def test_another_router_is_noted() -> None:
    (found,) = router(seen(routers=["1.9.0"]))
    assert (found.level, found.todo) == ("note", remedies.UPDATE)
    (found,) = router(seen(routers=[]))
    assert found.level == "note"


def test_services_that_are_missing_twice_stuck_or_late() -> None:
    told = {"safety": health("safety"), "odom": health("odom", lateness=0.3)}
    there = {"safety": 2, "odom": 1, "mine": 1}
    found = {each.text.split()[0]: each for each in services(seen(instances=there, health=told))}
    assert {name: (each.level, each.todo) for name, each in found.items()} == {
        "bridge": ("wrong", remedies.START),
        "safety": ("wrong", remedies.TWICE),
        "odom": ("note", remedies.HELD_UP),
        "mine": ("wrong", remedies.HANGS),
    }


def test_several_tools_of_one_name_are_no_trouble() -> None:
    told = {name: health(name) for name in (*THREE, "teleop")}
    there = dict.fromkeys(THREE, 1) | {"teleop": 2}
    assert levels(list(services(seen(instances=there, health=told)))) == {"ok"}


def test_versions_that_differ() -> None:
    told = {"bridge": health("bridge", version="0"), "safety": health("safety")}
    (found,) = versions(seen(health=told))
    assert (found.level, found.text) == ("note", "bridge is T2 0, this laptop 1")
    found = list(versions(seen(undecodable={"tel/x": "not a Bumper"})))[-1]
    assert (found.level, found.text) == ("wrong", "tel/x: not a Bumper")


@pytest.mark.parametrize(
    ("given", "level", "said"),
    [
        ({}, "ok", "watch, call and drive"),
        ({"may_drive": False}, "note", "no way to safety for driving"),
        ({"may_drive": False, "may_call": False}, "note", "driving and calls"),
        ({"may_drive": None, "may_call": None}, "unknown", "want safety"),
        ({"instances": {}}, "unknown", "nobody is there"),
        ({"rates": {}}, "wrong", "nothing is heard"),
    ],
)
def test_rights(given: dict[str, object], level: str, said: str) -> None:
    (found,) = rights(seen(**given))
    assert found.level == level
    assert said in found.text


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"delays_s": []}, [("unknown", "nothing was heard")]),
        ({"delays_s": [0.004, 0.05]}, [("ok", "agree to 4 ms")]),
        ({"delays_s": [5.0]}, [("note", "5.0 s ahead of")]),
        ({"delays_s": [-5.0]}, [("note", "5.0 s behind")]),
        ({"delays_s": [0.0, 0.3]}, [("note", "0.30 s longer"), ("ok", "agree")]),
        ({"one_clock": True}, [("ok", "this very host")]),
    ],
)
def test_clocks(given: dict[str, object], expected: list[tuple[str, str]]) -> None:
    found = list(clock(seen(**given)))
    assert [each.level for each in found] == [level for level, _ in expected]
    for each, (_, said) in zip(found, expected, strict=True):
        assert said in each.text
