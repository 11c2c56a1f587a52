"""JSON schemas, made from the structs."""

import msgspec
import pytest

from common.keys import TOPICS, Topic
from common.messages import Message
from common.schema import schemas


def test_schemas_are_by_path_and_in_its_order() -> None:
    by_path = {topic.path: topic for topic in TOPICS}
    made = schemas([by_path["tel/bridge/link"], by_path["tel/bridge/bumper"]])
    assert list(made) == ["tel/bridge/bumper", "tel/bridge/link"]
    bumper = made["tel/bridge/bumper"]["$defs"]["Bumper"]
    assert bumper["properties"]["pressed"] == {"type": "boolean"}
    assert "pressed" in bumper["required"]


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.path)
def test_every_topic_has_a_schema_that_is_json(topic: Topic[Message]) -> None:
    assert topic.message.__name__ in msgspec.json.encode(schemas([topic])).decode()
