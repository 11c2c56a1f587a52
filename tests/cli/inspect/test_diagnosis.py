"""Diagnosis of an observation: laptop to services."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from cli.inspect import remedies
from cli.inspect.diagnosis import (
    Finding,
    Observation,
    clock,
    diagnose_bus,
    rights,
    robot,
    router,
    services,
    versions,
)
from common.messages import Health
from tests.cli.inspect.tool import health

THREE = ("bridge", "safety", "odom")
Check = Callable[[Observation], Iterator[Finding]]


def healths(*messages: Health) -> dict[str, Health]:
    return {f"tel/{each.service}/health": each for each in messages}


def seen(**given: Any) -> Observation:
    """Return the observation of a healthy robot, with the given differences."""
    healthy: dict[str, Any] = {
        "zenoh": "1.10.2", "t2": "1", "routers": ["1.10.2"],
        "instances": dict.fromkeys(THREE, 1), "may_drive": True, "may_call": True,
        "newest": healths(*map(health, THREE)), "delays_s": [0.01, 0.02],
        "rates": {"tel/bridge/bumper": 50.0},
    }  # fmt: skip
    return Observation(**(healthy | given))


def test_a_healthy_robot() -> None:
    assert {each.level for each in diagnose_bus(seen())} == {"ok"}


def test_a_wrong_robot_gets_the_names_of_the_others() -> None:
    (found,) = robot(seen(instances={}, others=["001", "berlin-2"]), "002")
    assert (found.level, found.todo) == ("wrong", remedies.NO_ROBOT)
    assert found.text == "no service of robot 002 is here; the router knows 001, berlin-2"
    assert not list(robot(seen(others=["002"]), "001"))
    assert not list(robot(seen(instances={}), "001"))


def test_services_that_are_missing_duplicate_hanging_or_late() -> None:
    late = healths(health("safety"), health("odom", lateness=0.3), health("teleop"))
    instances = {"safety": 2, "odom": 1, "mine": 1, "teleop": 2}
    found = {
        each.text.split()[0]: each for each in services(seen(instances=instances, newest=late))
    }
    assert {name: (each.level, each.todo) for name, each in found.items()} == {
        "bridge": ("wrong", remedies.START),
        "safety": ("wrong", remedies.TWICE),
        "odom": ("note", remedies.STALLS),
        "mine": ("wrong", remedies.HANGS),
        "teleop": ("ok", ""),  # any number of a tool may run
    }


@pytest.mark.parametrize(
    ("check", "given", "expected"),
    [
        (router, {"routers": ["1.9.0"]}, [("note", "Zenoh 1.9.0, on this laptop 1.10.2")]),
        (router, {"routers": []}, [("note", "admin space is closed")]),
        (versions, {"newest": healths(health("bridge", version="0"), health("safety"))},
         [("note", "bridge is T2 0, this laptop 1")]),
        (versions, {"newest": {}, "undecodable": {"tel/x": "not a Bumper"}},
         [("wrong", "tel/x: not a Bumper")]),
        (rights, {}, [("ok", "read, call and drive")]),
        (rights, {"may_drive": False}, [("note", "does not receive its driving")]),
        (rights, {"may_drive": False, "may_call": False}, [("note", "driving and calls")]),
        (rights, {"may_drive": None, "may_call": None}, [("unknown", "require safety")]),
        (rights, {"instances": {}}, [("unknown", "no service found")]),
        (rights, {"rates": {}}, [("wrong", "no message arrives")]),
        (clock, {"delays_s": []}, [("unknown", "no message arrived")]),
        (clock, {"delays_s": [0.004, 0.05]}, [("ok", "agree to 4 ms")]),
        (clock, {"delays_s": [5.0]}, [("note", "5.0 s ahead of")]),
        (clock, {"delays_s": [-5.0]}, [("note", "5.0 s behind")]),
        (clock, {"delays_s": [0.0, 0.3]}, [("note", "0.30 s longer"), ("ok", "agree")]),
        (clock, {"one_clock": True}, [("ok", "on this host")]),
    ],
)  # fmt: skip
def test_checks(check: Check, given: dict[str, Any], expected: list[tuple[str, str]]) -> None:
    found = list(check(seen(**given)))
    assert [each.level for each in found] == [level for level, _ in expected]
    for each, (_, phrase) in zip(found, expected, strict=True):
        assert phrase in each.text
