"""Messages from the browser."""

import msgspec
import pytest

from common.messages import SwitchesRequest
from services.dashboard import client_messages as client

READ = msgspec.json.Decoder(client.AnyMessage)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"k":"take"}', client.Take()),
        ('{"k":"take","force":true}', client.Take(force=True)),
        ('{"k":"leave"}', client.Leave()),
        ('{"k":"hold","echo":3,"x":0.5,"y":-1}', client.Hold(3, 0.5, -1.0)),
        ('{"k":"hold","echo":3,"release":"backward"}', client.Hold(3, release="backward")),
        ('{"k":"free"}', client.Free()),
        ('{"k":"gear","gear":5}', client.Gear(5)),
        ('{"k":"alive","echo":3}', client.Alive(3)),
        ('{"k":"estop"}', client.Estop()),
        ('{"k":"reset","echo":9}', client.Reset(9)),
        (
            '{"k":"switch","to":{"bumper_brake":false,"echo":9}}',
            client.Switch(SwitchesRequest(bumper_brake=False, echo=9)),
        ),
    ],
)
def test_valid_messages_are_decoded(text: str, message: client.ClientMessage) -> None:
    assert READ.decode(text) == message


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        '{"k":"drive"}',
        '{"k":"hold"}',
        '{"k":"hold","echo":1,"x":"fast"}',
        '{"k":"hold","echo":1,"z":1}',
        '{"k":"hold","echo":1,"release":"sideways"}',
        '{"k":"reset"}',
        '{"k":"gear","gear":6}',
        '{"k":"gear","gear":0}',
    ],
)
def test_invalid_messages_are_refused(text: str) -> None:
    with pytest.raises(msgspec.DecodeError):
        READ.decode(text)
