import json

import msgspec

from sim.requests import Freeze
from sim.trace import BumperSent, Disturbed, Line, Power, read
from tests.sim.sim_fixture import START_NS, SimFixture


def test_truth_is_one_json_object_with_all_that_tests_judge_by() -> None:
    line = json.loads(msgspec.json.encode(SimFixture().truth))
    assert line["event"] == "truth"
    assert line["mono_ns"] == START_NS
    names = {"x", "y", "heading", "linear", "angular", "distance", "clearance", "contact"}
    assert names <= line.keys()


def test_lines_can_be_read_back_by_their_event() -> None:
    lines: list[Line] = [
        SimFixture().truth,
        BumperSent(mono_ns=1, pressed=True),
        Power(mono_ns=2, on=False),
        Disturbed(mono_ns=3, request=Freeze(seconds=1.0)),
    ]
    text = b"".join(msgspec.json.encode(line) + b"\n" for line in lines)
    assert read(text) == lines
    assert read(text + b'{"event": "tru') == lines
    assert read(b"") == []
