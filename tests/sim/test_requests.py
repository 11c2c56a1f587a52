from typing import Any

import msgspec
import pytest

from sim.requests import Asked, PowerCycle, Script, Wire


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (b'{"pressed": true}', "missing required field `do`"),
        (b'{"do": "dance"}', "Invalid value 'dance'"),
        (b'{"do": "bumper"}', "missing required field `pressed`"),
        (b'{"do": "bumper", "pressed": 1}', "Expected `bool`"),
        (b'{"do": "bumper", "pressed": true, "hard": true}', "unknown field `hard`"),
        (b'{"do": "sonar", "name": "top"}', "Invalid enum value 'top'"),
        (b'{"do": "driver", "side": "left", "bits": -1}', ">= 0"),
        (b'{"do": "place", "x": 1e300, "y": 0}', "<= 1000.0"),
        (b'{"do": "freeze", "seconds": -1}', ">= 0"),
        (b'{"do": "add_box", "box": {"name": "b", "x": 0, "y": 0, "length": 0}}', ">= 0.01"),
        (b"[]", "Expected `object`"),
    ],
)
def test_a_wrong_request_is_refused_with_its_field(text: bytes, error: str) -> None:
    with pytest.raises(msgspec.ValidationError, match=error):
        msgspec.json.decode(text, type=Asked)


@pytest.mark.parametrize(
    ("text", "request_"),
    [
        (b'{"do": "power_cycle"}', PowerCycle(seconds=1.0)),
        (b'{"do": "wire", "drop": 0.5}', Wire(direction="both", drop=0.5)),
    ],
)
def test_what_is_left_out_has_a_default(text: bytes, request_: Any) -> None:
    assert msgspec.json.decode(text, type=Asked) == request_


def test_a_script_is_refused_with_the_step_that_is_wrong() -> None:
    steps = [{"at": 1, "request": {"do": "truth"}}, {"at": -1, "request": {"do": "truth"}}]
    with pytest.raises(msgspec.ValidationError, match=r"steps\[1\].at"):
        msgspec.convert({"steps": steps}, Script)
