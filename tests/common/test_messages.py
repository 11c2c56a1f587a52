"""Limits of what a message may contain."""

import math
from collections.abc import Iterator

import pytest
from msgspec import Struct, inspect

from t2.codec import decode, encode
from t2.errors import MessageError
from t2.keys import CALLS, TOPICS
from t2.messages import (
    MAX_TEXT,
    Command,
    Drive,
    Event,
    Limit,
    Mileage,
    Motion,
    PoseRequest,
    Ultrasonic,
    Velocity,
)


def unbounded(kind: inspect.Type, at: str) -> Iterator[str]:
    """Yield where a text, list or map has no maximum length, or a number may be NaN."""
    sized = inspect.StrType | inspect.BytesType | inspect.CollectionType | inspect.DictType
    if isinstance(kind, sized) and kind.max_length is None:
        yield at
    if isinstance(kind, inspect.FloatType) and None in (kind.ge, kind.le):
        yield at
    for name in ("item_type", "key_type", "value_type"):
        if hasattr(kind, name):
            yield from unbounded(getattr(kind, name), f"{at}[]")
    for part in (*getattr(kind, "types", ()), *getattr(kind, "item_types", ())):
        yield from unbounded(part, at)
    for field in getattr(kind, "fields", ()):
        yield from unbounded(field.type, f"{at}.{field.name}")


KINDS: dict[str, type[Struct]] = {topic.message.__name__: topic.message for topic in TOPICS}
KINDS |= {kind.__name__: kind for call in CALLS for kind in (call.request, call.reply)}


@pytest.mark.parametrize("name", sorted(KINDS))
def test_every_text_list_and_number_of_a_message_has_limits(name: str) -> None:
    assert list(unbounded(inspect.type_info(KINDS[name]), name)) == []


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, 1.1e9])
def test_a_number_that_is_not_finite_does_not_decode(wrong: float) -> None:
    for message in (
        Velocity(linear=0.0, angular=wrong),
        Mileage(distance=wrong, heading=0.0, epoch=0),
        Ultrasonic(ranges=(wrong,) * 8, status=("ok",) * 8),
        Drive(linear=wrong, angular=0.0, echo=0),
        Limit(linear=wrong, echo=0),
        Motion(command=Command.RUN, linear=wrong),
        PoseRequest(x=wrong),
    ):
        with pytest.raises(MessageError, match=r"Expected `float` [<>]= .* - at `\$"):
            decode(encode(message), type(message))


def test_a_longer_text_does_not_decode() -> None:
    longest = Event(name="stop", level="info", text="急" * MAX_TEXT)
    assert decode(encode(longest), Event) == longest
    with pytest.raises(MessageError, match=r"length <= 4000 - at `\$\.text`"):
        decode(encode(Event(name="stop", level="info", text="x" * (MAX_TEXT + 1))), Event)
