"""Diagnosis of an observation: laptop to services."""

import pytest

from cli.inspect import remedies
from cli.inspect.diagnosis import (
    Attempt,
    Finding,
    Observation,
    clock,
    diagnose_bus,
    network,
    rights,
    robot,
    router,
    services,
    versions,
)
from tests.cli.inspect.tool import health

THREE = ("bridge", "safety", "odom")


def seen(**given: object) -> Observation:
    """Return the observation of a healthy robot, with the given differences."""
    healthy: dict[str, object] = {
        "zenoh": "1.10.2", "t2": "1", "routers": ["1.10.2"],
        "instances": dict.fromkeys(THREE, 1), "may_drive": True, "may_call": True,
        "health": {name: health(name) for name in THREE}, "delays_s": [0.01, 0.02],
        "rates": {"tel/bridge/bumper": 50.0},
    }  # fmt: skip
    return Observation(**(healthy | given))  # type: ignore[arg-type]


def levels(found: list[Finding]) -> set[str]:
    return {each.level for each in found}


def test_a_healthy_robot() -> None:
    assert levels(list(diagnose_bus(seen()))) == {"ok"}


def test_a_wrong_robot_is_told_which_robots_are_there() -> None:
    (found,) = robot(seen(instances={}, others=["001", "berlin-2"]), "002")
    assert found.level == "wrong"
    assert found.text == "no service of robot 002 is here; the router knows 001, berlin-2"
    assert found.todo == remedies.NO_ROBOT
    assert not list(robot(seen(others=["002"]), "001"))
    assert not list(robot(seen(instances={}), "001"))


@pytest.mark.parametrize(
    ("attempts", "expected"),
    [
        ([Attempt("tcp/a:1", seconds=0.001)], ["ok"]),
        ([Attempt("tcp/a:1", "silence", "move")], ["wrong"]),
        ([Attempt("tcp/a:1", "silence", "move"), Attempt("tcp/b:1")], ["note", "ok"]),
        ([Attempt("udp/a:1", tried=False)], ["unknown"]),
    ],
)
def test_one_reachable_endpoint_is_enough(attempts: list[Attempt], expected: list[str]) -> None:
    found = list(network(attempts))
    assert [each.level for each in found] == expected
    assert all(attempt.endpoint in each.text for attempt, each in zip(attempts, found, strict=True))


def test_the_network_finding_has_its_remedy() -> None:
    (found,) = network([Attempt("tcp/a:1", "silence", "move")])
    assert (found.text, found.todo) == ("tcp/a:1: silence", "move")


def test_another_router_version_is_noted() -> None:
    (found,) = router(seen(routers=["1.9.0"]))
    assert (found.level, found.todo) == ("note", remedies.UPDATE)
    (found,) = router(seen(routers=[]))
    assert found.level == "note"


def test_services_that_are_missing_duplicate_hanging_or_late() -> None:
    healths = {"safety": health("safety"), "odom": health("odom", lateness=0.3)}
    instances = {"safety": 2, "odom": 1, "mine": 1}
    found = {
        each.text.split()[0]: each for each in services(seen(instances=instances, health=healths))
    }
    assert {name: (each.level, each.todo) for name, each in found.items()} == {
        "bridge": ("wrong", remedies.START),
        "safety": ("wrong", remedies.TWICE),
        "odom": ("note", remedies.STALLS),
        "mine": ("wrong", remedies.HANGS),
    }


def test_several_tools_of_one_name_are_allowed() -> None:
    healths = {name: health(name) for name in (*THREE, "teleop")}
    instances = dict.fromkeys(THREE, 1) | {"teleop": 2}
    assert levels(list(services(seen(instances=instances, health=healths)))) == {"ok"}


def test_versions_that_differ() -> None:
    healths = {"bridge": health("bridge", version="0"), "safety": health("safety")}
    (found,) = versions(seen(health=healths))
    assert (found.level, found.text) == ("note", "bridge is T2 0, this laptop 1")
    found = list(versions(seen(undecodable={"tel/x": "not a Bumper"})))[-1]
    assert (found.level, found.text) == ("wrong", "tel/x: not a Bumper")


@pytest.mark.parametrize(
    ("given", "level", "phrase"),
    [
        ({}, "ok", "read, call and drive"),
        ({"may_drive": False}, "note", "does not receive its driving"),
        ({"may_drive": False, "may_call": False}, "note", "driving and calls"),
        ({"may_drive": None, "may_call": None}, "unknown", "require safety"),
        ({"instances": {}}, "unknown", "no service found"),
        ({"rates": {}}, "wrong", "no message arrives"),
    ],
)
def test_rights(given: dict[str, object], level: str, phrase: str) -> None:
    (found,) = rights(seen(**given))
    assert found.level == level
    assert phrase in found.text


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"delays_s": []}, [("unknown", "no message arrived")]),
        ({"delays_s": [0.004, 0.05]}, [("ok", "agree to 4 ms")]),
        ({"delays_s": [5.0]}, [("note", "5.0 s ahead of")]),
        ({"delays_s": [-5.0]}, [("note", "5.0 s behind")]),
        ({"delays_s": [0.0, 0.3]}, [("note", "0.30 s longer"), ("ok", "agree")]),
        ({"one_clock": True}, [("ok", "on this host")]),
    ],
)
def test_clocks(given: dict[str, object], expected: list[tuple[str, str]]) -> None:
    found = list(clock(seen(**given)))
    assert [each.level for each in found] == [level for level, _ in expected]
    for each, (_, phrase) in zip(found, expected, strict=True):
        assert phrase in each.text
