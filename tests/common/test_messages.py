"""Limits of what a message may contain."""

from collections.abc import Iterator

import pytest
from msgspec import Struct, inspect

from common.codec import decode, encode
from common.errors import MessageError
from common.keys import CALLS, TOPICS
from common.messages import MAX_TEXT, Event


def unbounded(kind: inspect.Type, at: str) -> Iterator[str]:
    """Yield where a type has a text, a list or a map without a maximum length."""
    sized = inspect.StrType | inspect.BytesType | inspect.CollectionType | inspect.DictType
    if isinstance(kind, sized) and kind.max_length is None:
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
def test_every_text_and_list_of_a_message_has_a_maximum_length(name: str) -> None:
    assert list(unbounded(inspect.type_info(KINDS[name]), name)) == []


def test_a_longer_text_does_not_decode() -> None:
    longest = Event(name="stop", level="info", text="急" * MAX_TEXT)
    assert decode(encode(longest), Event) == longest
    with pytest.raises(MessageError, match=r"length <= 4000 - at `\$\.text`"):
        decode(encode(Event(name="stop", level="info", text="x" * (MAX_TEXT + 1))), Event)
