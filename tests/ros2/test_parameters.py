"""Answers of the six parameter services."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.ros2 import cdr, parameters
from services.ros2.config import Ros2Config
from services.ros2.parameters import NOT_SET, READ_ONLY, SERVICES
from t2.messages import Limits
from tests.ros2 import oracle

LIMITS = Limits(forward=0.5, backward=0.25, angular=1.0)
KNOWN = parameters.parameters(Ros2Config(), LIMITS)


def respond(name: str, *request: Any) -> Any:
    return SERVICES[name][1](KNOWN, *request)


def test_the_parameters_are_the_settings_and_the_limits_of_now() -> None:
    assert KNOWN["ros2.cmd_vel"] == "stamped"
    assert KNOWN["vehicle.length"] == 1.1
    assert KNOWN["limits.backward"] == 0.25
    silent = parameters.parameters(Ros2Config(), None)
    assert not [name for name in silent if name.startswith("limits")]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ros2.publish_tf", (1, True, 0, 0.0, "", (), (), (), (), ())),
        ("ros2.domain", (2, False, 0, 0.0, "", (), (), (), (), ())),
        ("limits.forward", (3, False, 0, 0.5, "", (), (), (), (), ())),
        ("ros2.cmd_vel", (4, False, 0, 0.0, "stamped", (), (), (), (), ())),
        ("unknown", NOT_SET),
    ],
)
def test_a_value_has_its_kind(name: str, value: Any) -> None:
    assert respond("get_parameters", (name,)) == ((value,),)
    assert respond("get_parameter_types", (name,)) == ((value[0],),)
    described = (name, value[0], "", "", True, False, (), ())
    assert respond("describe_parameters", (name,)) == ((described,),)


@pytest.mark.parametrize(
    ("prefixes", "depth", "listed"),
    [
        ((), 0, len(KNOWN)),
        ((), 1, 0),
        ((), 2, len(KNOWN)),
        (("limits",), 0, 3),
        (("limits",), 1, 3),
        (("limits", "ros2.domain"), 1, 4),
        (("limit", "limits.forward.x", ""), 0, 0),
    ],
)
def test_names_are_listed_by_prefix_and_depth(
    prefixes: tuple[str, ...], depth: int, listed: int
) -> None:
    ((names, groups),) = respond("list_parameters", prefixes, depth)
    assert len(names) == listed
    assert groups == tuple(sorted({name.split(".")[0] for name in names}))


def test_all_parameters_can_be_read() -> None:
    names = tuple(KNOWN)
    (values,), (kinds,), (described,) = (
        respond(name, names)
        for name in ("get_parameters", "get_parameter_types", "describe_parameters")
    )
    assert [value[0] for value in values] == [*kinds] == [each[1] for each in described]
    assert set(kinds) == {1, 2, 3, 4}


def test_nothing_can_be_set() -> None:
    changes = (("ros2.domain", NOT_SET), ("x", NOT_SET))
    assert respond("set_parameters", changes) == ((READ_ONLY, READ_ONLY),)
    assert respond("set_parameters_atomically", changes) == (READ_ONLY,)


@pytest.mark.parametrize("name", SERVICES)
@given(data=st.data())
def test_every_request_has_a_response(name: str, data: st.DataObject) -> None:
    interface, _ = SERVICES[name]
    request = data.draw(oracle.values(f"{interface}_Request"))
    for fields in (request, ()):  # () is a request that cannot be read
        made = respond(name, *fields)
        assert (
            cdr.decode(f"{interface}_Response", cdr.encode(f"{interface}_Response", made)) == made
        )
