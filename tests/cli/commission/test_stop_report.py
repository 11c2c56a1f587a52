"""The result of ``t2 checkout stop`` as text, as JSON and as a verdict."""

import json
from collections import Counter
from collections.abc import Sequence

import pytest
from msgspec.structs import replace

from cli.commission.stop_report import Measured, Result, as_json, as_text, evaluate
from cli.commission.stops import Stop
from cli.inspect import output
from services.safety.config import Safety
from tests.cli.commission.stops_fixture import stop, stops

CAREFUL = Safety(react=0.4, deceleration=0.5)


def result(
    found: Sequence[Stop], present: Safety = CAREFUL, left_out: Counter[str] | None = None
) -> Result:
    return evaluate(Measured(found, left_out or Counter(), 0.02), present, 0.1)


def test_safe_settings() -> None:
    one = result(stops(), left_out=Counter({"turning": 2, "slower than 0.1 m/s": 7}))
    text = as_text(one)
    assert one.passed
    assert one.verdict == "safe"
    assert "\n   1  STOP forward " in text
    assert "Left out: 7 slower than 0.1 m/s, 2 turning.\n" in text
    assert "\nSTOP backward      5  0.30 to 1.00  0.102 (" in text
    assert "resolved to 0.020 s" in text
    assert "\n[safety]\nreact = 0.23  # s: 0.1" in text
    assert "0.100 from the reading to it\ndeceleration = 0.7" in text
    assert "\nmargin = 0.20  # m\n" in text
    assert "react 0.4 s, deceleration 0.5 m/s2, margin 0.2 m.\nThey are safe: " in text
    assert "NOT" not in text


def test_a_stop_that_was_too_long() -> None:
    one = result([*stops(), stop(0.6, distance=0.62)], Safety())
    assert (one.passed, one.verdict) == (False, "not safe")
    assert "\nNOT safe: stop 11 took 0.62 m, reckoned 0.45 m." in as_text(one)
    assert "They are safe" not in as_text(one)


def test_settings_that_are_less_cautious_than_proposed() -> None:
    one = result(stops(), replace(CAREFUL, react=0.1))
    assert not one.too_long
    assert (one.passed, one.verdict) == (False, "less cautious than proposed")
    assert "\nLess cautious than proposed: 0.0" in as_text(one)
    assert "m less room at 0.20 m/s." in as_text(one)


def test_too_few_stops() -> None:
    one = result([stop(0.5)])
    assert (one.passed, one.verdict, one.proposal, one.shortfall) == (
        False, "unknown", None, (0.0, 0.0),
    )  # fmt: skip
    text = as_text(one)
    assert "\n- 4 more STOP forward\n- 5 more STOP backward\n" in text
    assert "Unknown whether they are safe" in text
    assert "[safety]" not in text
    assert "next at most" not in text


def test_a_stop_that_became_brake_is_marked() -> None:
    assert "   1  STOP forward, then BRAKE      0.500 " in "\n" + as_text(
        result([stop(0.5, braked=True)])
    )


def test_too_few_stops_and_one_too_long() -> None:
    one = result([stop(0.6, distance=0.62)], Safety())
    assert (one.passed, one.verdict) == (False, "not safe")
    assert "Unknown" not in as_text(one)


def test_brakes_that_are_too_weak_for_any_setting() -> None:
    weak = [stop(v, 0.1, 0.09, direction=d) for d in ("forward", "backward") for v in
            (0.3, 0.5, 0.7, 0.9, 1.0)]  # fmt: skip
    one = result(weak, replace(CAREFUL, deceleration=0.05, unsafe_overrides=("deceleration",)))
    assert (one.passed, one.verdict, one.too_long) == (False, "not safe", [])
    assert "No settings are proposed: the next stop may decelerate with 0.09" in as_text(one)
    assert "\nNOT safe: no settings are." in as_text(one)


def test_json() -> None:
    found = [*stops(), stop(0.6, distance=0.62, kind="brake", file="a.mcap")]
    printed = json.loads(output.json(as_json(result(found, Safety(), Counter({"turning": 1})))))
    assert printed["stops"][10].pop("reckoned") == pytest.approx(0.45)
    assert printed["stops"][10] == {
        "kind": "brake", "direction": "forward", "speed": 0.6, "reaction": 0.1,
        "deceleration": 0.8, "distance": 0.62, "file": "a.mcap", "braked": False, "long": True,
        "command": [0, 0],
    }  # fmt: skip
    assert not printed["stops"][0]["long"]
    assert printed["left_out"] == {"turning": 1}
    assert printed["fits"][1]["direction"] == "backward"
    assert printed["fits"][1]["reaction"]["next_high"] > 0.12
    assert printed["proposal"]["react"] == 0.23
    assert printed["present"] == {
        "react": 0.25, "deceleration": 0.6, "margin": 0.2, "verdict": "not safe",
    }  # fmt: skip
    assert (printed["missing"], printed["problem"]) == ([], "")
    assert (printed["resolution"], printed["sensing"]) == (0.02, 0.1)
    assert as_json(result([stop(0.5)]))["proposal"] is None
