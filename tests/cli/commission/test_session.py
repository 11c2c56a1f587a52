"""``t2 checkout`` on a real stack whose messages queue up while a question waits for its answer."""

from pathlib import Path

import pytest

from cli.commission import steps
from cli.commission.session import CheckoutSession, checkout_session
from cli.commission.steps import FORWARD
from common.bus import inspector
from sim.requests import Bumper
from tests.cli.processes import PATIENCE_S
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

PHRASE = "wheels off the ground"


def nobody_reads(session: CheckoutSession) -> None:
    """Return once the queue has overflowed since now, twice its length."""
    before = session.inspector.left_out
    wait_until(
        lambda: session.inspector.left_out > before + 2 * inspector.QUEUE_MAX,
        "a full queue",
        PATIENCE_S,
    )


def hit(stack: RunningStack) -> None:
    """Press and release the bumper; return once safety has latched it."""
    before = stack.log.read_text().count('"cause": "contact"')
    stack.control.do(Bumper(pressed=True))
    wait_until(lambda: stack.log.read_text().count('"cause": "contact"') > before, "a latch")
    stack.control.do(Bumper(pressed=False))


def test_a_hit_during_a_question_is_seen_and_reset_and_ends_a_motion(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A queue that is full within a second: the real one takes a question of a minute.
    monkeypatch.setattr(inspector, "QUEUE_MAX", 200)
    with running_stack(tmp_path) as stack, checkout_session(stack.config) as session:
        wait_until(lambda: not session.fresh_state().latched, "a healthy vehicle", PATIENCE_S)
        nobody_reads(session)
        hit(stack)
        nobody_reads(session)
        assert session.fresh_state().latched == ("contact",)
        nobody_reads(session)

        def is_reset() -> bool:
            done = session.reset()
            assert "heartbeat" not in done.text  # an unknown one is that of an old state
            return done.granted and not done.latched

        wait_until(is_reset, "a reset", PATIENCE_S)

        asked: list[str] = []

        def prompt(question: str) -> str:
            asked.append(question)
            nobody_reads(session)
            if PHRASE not in question:
                return "reset"
            hit(stack)
            nobody_reads(session)
            return PHRASE

        monkeypatch.setattr(steps, "prompt", prompt)
        monkeypatch.setattr("cli.commission.session.READY_S", 60.0)
        found = steps.move(FORWARD, session)
        assert any(PHRASE in question for question in asked)
        assert found.outcome == "failed"
        assert "The bumper was hit." in found.text
        assert stack.last() != "run"
