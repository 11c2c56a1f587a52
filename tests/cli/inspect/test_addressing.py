"""Short keys, whole keys and invalid keys."""

import argparse

import pytest

from cli.inspect.addressing import expression, parse_key, topic_of
from t2 import keys


@pytest.mark.parametrize(
    ("word", "key"),
    [
        ("tel/odom/odometry", "t2/v1/7/tel/odom/odometry"),
        ("odometry", "t2/v1/7/tel/odom/odometry"),
        ("/safety/health", "t2/v1/7/tel/safety/health"),
        ("drive/nav", "t2/v1/7/@cmd/drive/nav"),
        ("bridge/none", "t2/v1/7/bridge/none"),
        ("mine/tel/safety/state", "t2/v1/7/mine/tel/safety/state"),
        ("health", "t2/v1/7/tel/*/health"),
        ("estop", "t2/v1/7/estop"),
        ("**", "t2/v1/7/**"),
        ("t2/v1/2/tel/**", "t2/v1/2/tel/**"),
    ],
)
def test_whole_key_of_a_typed_key(word: str, key: str) -> None:
    assert parse_key(word) == word
    assert expression(word, "7") == key


@pytest.mark.parametrize("word", ["", "/", "tel//odom"])
def test_invalid_keys(word: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="is not a key"):
        parse_key(word)


def test_topic_of_a_key() -> None:
    assert topic_of("t2/v1/7/tel/bridge/driver/left") is keys.DRIVER
    assert topic_of("t2/v1/7/tel/mine/health") is keys.HEALTH
    assert topic_of("t2/v1/7/tel/mine/x/y") is None
    assert topic_of("t2/v1/7/tel/mine/temperature") is None
    assert topic_of("elsewhere") is None
