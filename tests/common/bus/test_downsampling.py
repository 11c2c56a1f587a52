"""Downsampling of the robot's streams for laptops."""

import json
from typing import Any

import pytest
import zenoh

from common import keys
from common.bus.downsampling import downsampling_rules
from common.bus.session import router_config
from common.keys import COMMAND, FAST, TOPICS
from common.settings import BusSettings


def rules(rate_hz: float) -> dict[str, float]:
    (thin,) = downsampling_rules("007", rate_hz)["downsampling"]
    return {rule["key_expr"]: rule["freq"] for rule in thin["rules"]}


def test_fast_streams_are_thinned_and_nothing_else() -> None:
    fast = {topic.on("007") for topic in TOPICS if topic.service is FAST and topic.rate_hz > 10}
    assert set(rules(10.0)) == {*fast, keys.MOTION.on("007")}


@pytest.mark.parametrize("topic", [keys.SAFETY, keys.EVENTS, keys.DRIVE, keys.HEALTH, keys.LINK])
def test_what_drives_and_what_is_rare_is_untouched(topic: keys.Topic[Any]) -> None:
    assert topic.on("007", source="teleop", service="safety") not in rules(10.0)


def test_the_state_goes_ahead_of_the_streams_and_behind_commands() -> None:
    ahead = [COMMAND.priority, keys.SAFETY.service.priority, FAST.priority]
    assert ahead == ["INTERACTIVE_HIGH", "INTERACTIVE_LOW", "DATA_HIGH"]


@pytest.mark.parametrize(
    ("wanted_hz", "every"), [(10.0, 5), (5.0, 10), (12.0, 5), (25.0, 2), (49.0, 2)]
)
def test_every_so_manieth_passes_early_or_late_by_less_than_half(
    wanted_hz: float, every: int
) -> None:
    held_s = 1 / rules(wanted_hz)[keys.BUMPER.on("007")]
    assert (every - 1) / 50 < held_s < every / 50


def test_a_rate_that_no_stream_exceeds_thins_nothing() -> None:
    assert downsampling_rules("007", 50.0) == {}


def test_a_router_of_a_robot_thins_what_goes_out_by_tls_and_nothing_on_board() -> None:
    config = router_config(BusSettings(), robot="007")
    zenoh.Config.from_json5(json.dumps(config))  # which refuses what it does not know
    (thin,) = downsampling_rules("007", BusSettings().laptop_rate)["downsampling"]
    assert config["downsampling"] == [thin]
    assert (thin["flows"], thin["messages"]) == (["egress"], ["put"])
    assert not {"tcp", "unixsock-stream"} & set(thin["link_protocols"])


def test_a_router_of_no_robot_thins_nothing() -> None:
    assert "downsampling" not in router_config(BusSettings())
