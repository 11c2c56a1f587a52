"""Messages from the browser."""

import msgspec
import pytest

from common.messages import LedRequest, SwitchesRequest
from services.dashboard import client_messages as client

READ = msgspec.json.Decoder(client.AnyMessage)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('{"k":"look","robot":"001","name":"Ada"}', client.Look("001", "Ada")),
        ('{"k":"take"}', client.Take()),
        ('{"k":"take","force":true}', client.Take(force=True)),
        ('{"k":"leave"}', client.Leave()),
        ('{"k":"hold","n":3,"x":0.5,"y":-1}', client.Hold(3, 0.5, -1.0)),
        ('{"k":"hold","n":3,"x":0,"y":0,"release":"backward"}', client.Hold(3, release="backward")),
        ('{"k":"free"}', client.Free()),
        ('{"k":"gear","gear":5}', client.Gear(5)),
        ('{"k":"estop"}', client.Estop()),
        ('{"k":"estop","robot":"002"}', client.Estop("002")),
        ('{"k":"reset"}', client.Reset(0)),
        ('{"k":"reset","n":9}', client.Reset(9)),
        (
            '{"k":"switch","n":9,"to":{"bumper_brake":false}}',
            client.Switch(SwitchesRequest(bumper_brake=False), 9),
        ),
        ('{"k":"lamp","to":{"channel":1,"mode":2}}', client.Lamp(LedRequest(channel=1, mode=2))),
    ],
)
def test_valid_messages_are_decoded(text: str, word: client.ClientMessage) -> None:
    assert READ.decode(text) == word


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[1]",
        '{"k":"drive"}',
        '{"k":"hold"}',
        '{"k":"hold","n":1,"x":"fast"}',
        '{"k":"hold","n":1,"z":1}',
        '{"k":"hold","n":1,"release":"sideways"}',
        '{"k":"estop","robot":"a/b"}',
        '{"k":"gear","gear":6}',
        '{"k":"gear","gear":0}',
        '{"k":"look","robot":"*"}',
        '{"k":"look","robot":"a/b"}',
        '{"k":"look","robot":"001","name":"' + "x" * 25 + '"}',
        '{"k":"lamp","to":{"channel":256,"mode":1}}',
    ],
)
def test_invalid_messages_are_refused(text: str) -> None:
    with pytest.raises(msgspec.DecodeError):
        READ.decode(text)
