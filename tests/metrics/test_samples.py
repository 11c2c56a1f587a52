"""Exported samples: names, labels and freshness."""

import re
from typing import get_args

from common.freshness import NS_PER_S
from services.metrics.robot import FRESH_S, RobotState
from services.metrics.samples import metric_families
from t2 import messages as m
from t2.messages import Durations
from tests.factories import fix_state, health, map_pose, odometry
from tests.metrics.robots import (
    LINK,
    MAP_POSE,
    NOW_NS,
    ODOMETRY,
    PATROL,
    SAFETY,
    Values,
    event,
    flat,
    link,
    names,
    patrol,
    safety,
    whole,
)

# Exported for a robot without fresh values.
ALWAYS = {"t2_bus_connected", "t2_robot_up", "t2_service_up", "t2_service_instances"}
LATE_NS = NOW_NS + round(FRESH_S * NS_PER_S) + 1


def values(robot: RobotState, now_ns: int = NOW_NS) -> Values:
    """Return the value of every sample by name and labels."""
    return flat(metric_families({"007": robot}, now_ns, connected=True))


def value(found: Values, name: str, /, **labels: str) -> float:
    return found[name, frozenset({"robot": "007", **labels}.items())]


def of_name(found: Values, wanted: str) -> dict[str, float]:
    """Return the samples of a metric by its label ``name``."""
    return {dict(labels)["name"]: each for (name, labels), each in found.items() if name == wanted}


def test_fields_and_their_names() -> None:
    found = values(whole())
    assert value(found, "t2_link_epoch") == 2
    assert value(found, "t2_odometry_angular_radians_per_second") == -0.2
    assert value(found, "t2_safety_limits_forward_meters_per_second") == 1  # of a struct inside
    assert value(found, "t2_service_instances", service="bridge") == 1
    assert value(found, "t2_service_rss_bytes", service="bridge") == 50_000_000
    assert value(found, "t2_service_version", service="bridge", name="0.1.0") == 1
    ids_and_sentences = re.compile("boot|seq|text|waiting|frame_id")
    assert not [name for name in names(found) if ids_and_sentences.search(name)]


def test_words_of_a_fixed_set_are_one_or_zero_and_others_are_one_while_they_hold() -> None:
    robot = whole()
    robot.on_message(SAFETY, safety("contact", "estop"), NOW_NS)
    found = values(robot)
    verdicts = {"run": 0, "slow": 0, "stop": 0, "brake": 1, "inhibited": 0}
    assert of_name(found, "t2_safety_verdict") == verdicts
    assert of_name(found, "t2_safety_latched") == {"contact": 1, "estop": 1}
    robot.on_message(SAFETY, safety("limit", "limit"), NOW_NS)  # listed twice
    assert of_name(values(robot), "t2_safety_causes") == {"limit": 1}


def test_a_round() -> None:
    robot = whole()
    robot.on_message(PATROL, patrol("stopped"), NOW_NS)
    found = values(robot)
    states = of_name(found, "t2_patrol_state")
    assert {name for name, number in states.items() if number} == {"stopped"}
    assert set(states) == {*get_args(m.RoundState)}
    for name, number in (("progress", 3.0), ("deviation", 0.2), ("sigma", 0.1)):
        assert value(found, f"t2_patrol_{name}_meters") == number
    assert not {"t2_patrol_route", "t2_patrol_round", "t2_patrol_actions"} & names(found)


def test_the_pose_in_the_map_and_its_uncertainty() -> None:
    robot = whole()
    robot.on_message(MAP_POSE, map_pose("lost", sources=(fix_state(),)), NOW_NS)
    found = values(robot)
    states = {"unplaced": 0, "placed": 0, "lost": 1}
    assert of_name(found, "t2_localization_state") == states
    assert value(found, "t2_localization_sigma_meters") == 0.2
    assert value(found, "t2_localization_x_meters") == 4.0
    robot.on_message(MAP_POSE, map_pose("unplaced"), NOW_NS)
    absent = {"t2_localization_sigma_meters", "t2_localization_x_meters"}
    assert not absent & names(values(robot))
    links = {"up": 1, "lost": 0, "never": 0}
    assert of_name(found, "t2_link_state") == links


def test_stale_values_are_not_exported() -> None:
    robot = whole()
    robot.on_event("bridge", event("contact"))
    found = values(robot, LATE_NS)
    assert names(found) == {*ALWAYS, "t2_events_total"}
    assert value(found, "t2_robot_up") == 0
    assert value(found, "t2_service_up", service="bridge") == 0


def test_unknown_values_have_no_sample() -> None:
    robot = whole()
    robot.on_message(LINK, link(round_trip=None), NOW_NS)
    robot.on_message(ODOMETRY, odometry(residual=None), NOW_NS)
    robot.on_message(SAFETY, safety(source=None), NOW_NS)
    found = names(values(robot))
    absent = {"t2_link_round_trip_seconds", "t2_odometry_residual_meters", "t2_safety_source"}
    assert absent <= names(values(whole()))
    assert not absent & found


def test_maps_are_exported_by_key() -> None:
    robot = whole()
    other = "t2/v1/008/tel/bridge/link"  # of another robot
    reflex = Durations(bounds=(0.001, 0.01), counts=(5, 0, 2), worst=1.0)
    message = health(
        rates={"t2/v1/007/tel/bridge/link": 5.0, other: 4.0},
        counters={"overrun": 2},
        reactions={"reflex": reflex},
    )
    robot.on_message("tel/bridge/health", message, NOW_NS)
    found = values(robot)
    assert of_name(found, "t2_service_rates_hertz") == {"tel/bridge/link": 5, other: 4}
    assert of_name(found, "t2_service_counters") == {"overrun": 2}
    assert of_name(found, "t2_service_reactions_seconds") == {"reflex": 1.0}
