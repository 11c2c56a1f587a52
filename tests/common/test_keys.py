"""The table of keys: complete, unambiguous, and out of reach of a stray ``put t2/**``."""

import pytest
import zenoh

from t2 import keys, messages
from t2.keys import CALLS, TOPICS, Call, Topic
from t2.messages import Message

NAMES = {"side": "left", "service": "bridge", "source": "web", "camera": "front"}


def whole(topic: Topic[Message]) -> str:
    """Return a topic's key with its names filled in."""
    return topic.on("001", **NAMES)


def every_key() -> list[str]:
    return [
        *map(whole, TOPICS),
        *(call.on("001") for call in CALLS),
        keys.estop_key("001"),
        *(keys.info_key("001", "bridge", part) for part in ("schema", "config", "last")),
        keys.live_key("001", "bridge", "1"),
    ]


def test_the_tables_hold_every_topic_and_every_call() -> None:
    declared = vars(keys).values()
    assert {id(t) for t in declared if isinstance(t, Topic)} == {id(t) for t in TOPICS}
    assert {id(c) for c in declared if isinstance(c, Call)} == {id(c) for c in CALLS}


def test_every_message_has_its_topic() -> None:
    kinds = {
        kind
        for kind in vars(messages).values()
        if isinstance(kind, type) and issubclass(kind, Message)
    } - {Message, messages.SourceMessage}
    assert kinds == {topic.message for topic in TOPICS}


def test_all_keys_are_canonical_and_no_two_of_them_meet() -> None:
    found = [zenoh.KeyExpr(key) for key in every_key()]  # raises if it is not canonical
    meeting = [(str(a), str(b)) for a in found for b in found if a is not b and a.intersects(b)]
    assert meeting == []


@pytest.mark.parametrize("topic", [keys.DRIVE, keys.MOTION], ids=lambda topic: topic.path)
@pytest.mark.parametrize("stray", ["t2/**", "**", "t2/v1/*/**", "t2/v1/001/*/*"])
def test_a_stray_put_does_not_reach_the_wheels(topic: Topic[Message], stray: str) -> None:
    assert not zenoh.KeyExpr(stray).intersects(zenoh.KeyExpr(whole(topic)))


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.path)
def test_the_emergency_stop_goes_first_then_what_moves_the_wheels(topic: Topic[Message]) -> None:
    commands = topic.path.startswith("@cmd/") and topic is not keys.FIX  # it moves nothing
    assert (topic.service is keys.COMMAND) == commands
    assert topic.service.express == (commands or topic.service is keys.STATE)
    assert topic.service.priority != keys.ESTOP_CLASS.priority == "REAL_TIME"


def test_events_alone_have_a_history() -> None:
    """A motion that is replayed would move the robot on its own."""
    assert {topic.path for topic in TOPICS if topic.service.history} == {"evt/{service}"}
