"""What is sent while a hold drives and after."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.motion import STILL, Twist
from common.requests import ZEROS, Phase, Requests

GO = Twist(0.2, 0.1)

TABLE = [  # before, held, request, after
    (Requests(Phase.SILENT), None, None, Requests(Phase.SILENT)),
    (Requests(Phase.SILENT), GO, STILL, Requests(Phase.DRIVING)),
    (Requests(Phase.DRIVING), GO, GO, Requests(Phase.DRIVING)),
    (Requests(Phase.DRIVING), None, STILL, Requests(Phase.RELEASING, 2)),
    (Requests(Phase.RELEASING, 2), None, STILL, Requests(Phase.RELEASING, 1)),
    (Requests(Phase.RELEASING, 1), None, STILL, Requests(Phase.SILENT)),
    (Requests(Phase.RELEASING, 2), GO, STILL, Requests(Phase.DRIVING, 2)),
]


@pytest.mark.parametrize(("before", "held", "request_", "after"), TABLE)
def test_the_table(
    before: Requests, held: Twist | None, request_: Twist | None, after: Requests
) -> None:
    requests = replace(before)  # the table's own must not change
    assert requests.tick(held) == request_
    assert requests == after


@pytest.mark.parametrize("phase", Phase)
def test_stop_is_three_zeros_from_any_phase(phase: Phase) -> None:
    requests = Requests(phase, 1)
    requests.stop()
    assert [requests.tick(None) for _ in range(5)] == [STILL] * 3 + [None] * 2


@given(st.lists(st.sampled_from(["go", "idle", "stop"])))
def test_a_drive_begins_with_a_zero_and_ends_with_three(steps: list[str]) -> None:
    requests = Requests()
    sent = []
    for step in [*steps, *["idle"] * (ZEROS + 1)]:
        if step == "stop":
            requests.stop()
        else:
            sent.append(requests.tick(GO if step == "go" else None))
    assert sent[-1] is None
    for i, request in enumerate(sent):
        if request == GO:
            assert sent[i - 1] in (GO, STILL)
            assert i > 0
            assert sent[i + 1] is not None  # a zero or on with it, never silence
