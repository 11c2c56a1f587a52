"""What a browser may say."""

import msgspec
import pytest

from common.messages import LedRequest, SwitchesRequest
from services.dashboard import client_messages as w

READ = msgspec.json.Decoder(w.AnyWord)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('{"k":"look","robot":"001","name":"Ada"}', w.Look("001", "Ada")),
        ('{"k":"take"}', w.Take()),
        ('{"k":"take","force":true}', w.Take(force=True)),
        ('{"k":"leave"}', w.Leave()),
        ('{"k":"hold","n":3,"x":0.5,"y":-1}', w.Hold(3, 0.5, -1.0)),
        ('{"k":"hold","n":3,"x":0,"y":0,"release":"backward"}', w.Hold(3, release="backward")),
        ('{"k":"free"}', w.Free()),
        ('{"k":"gear","gear":5}', w.Gear(5)),
        ('{"k":"estop"}', w.Estop()),
        ('{"k":"estop","robot":"002"}', w.Estop("002")),
        ('{"k":"reset"}', w.Reset(0)),
        ('{"k":"reset","n":9}', w.Reset(9)),
        (
            '{"k":"switch","n":9,"to":{"bumper_brake":false}}',
            w.Switch(SwitchesRequest(bumper_brake=False), 9),
        ),
        ('{"k":"lamp","to":{"channel":1,"mode":2}}', w.Lamp(LedRequest(channel=1, mode=2))),
    ],
)
def test_the_words(text: str, word: w.Word) -> None:
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
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(msgspec.DecodeError):
        READ.decode(text)
