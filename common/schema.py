"""JSON schemas of what travels on the bus, made from the structs themselves."""

from collections.abc import Iterable
from typing import Any

import msgspec

from common.keys import Topic
from common.messages import Message


def schemas(topics: Iterable[Topic[Message]]) -> dict[str, Any]:
    """Return the JSON schema of each topic, by its path."""
    return {
        topic.path: msgspec.json.schema(topic.message)
        for topic in sorted(topics, key=lambda topic: topic.path)
    }
