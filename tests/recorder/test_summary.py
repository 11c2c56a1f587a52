"""Summary of a recording."""

import pytest

from common.freshness import NS_PER_S
from common.messages import Event, Health
from services.recorder.summary import Note, Summary
from tests.recorder import samples
from tests.recorder.samples import BEGIN_NS, ROOT

VELOCITY = f"{ROOT}/tel/bridge/velocity"


def test_an_empty_summary() -> None:
    summary = Summary()
    assert (summary.messages, summary.duration_s, summary.streams) == (0, 0.0, {})


def test_messages_and_rates_by_key() -> None:
    summary = Summary()
    for number in range(11):
        at_ns = BEGIN_NS + number * NS_PER_S // 10
        message = samples.velocity()
        summary.add(VELOCITY, "Velocity", message, at_ns, raw=number > 5)
    summary.add("t2/v1/001/tel/mine", "", None, BEGIN_NS + 2 * NS_PER_S, raw=False)
    assert (summary.messages, summary.duration_s) == (12, 2.0)
    assert summary.streams[VELOCITY].hz == pytest.approx(10.0)
    assert (summary.streams[VELOCITY].count, summary.streams[VELOCITY].raw) == (11, 5)
    assert summary.streams["t2/v1/001/tel/mine"].hz is None
    assert summary.begin_ns == BEGIN_NS
    assert not summary.faulty


def test_invalid_messages_are_counted() -> None:
    summary = Summary()
    summary.add(VELOCITY, "Velocity", None, BEGIN_NS, raw=False)
    assert summary.faulty == {VELOCITY: 1}


def test_events_latches_and_versions() -> None:
    summary = Summary()
    health = Health(
        service="odom", version="1.2", uptime=0, rates={}, counters={}, lateness=0, rss=0
    )
    event = Event(name="contact", level="error", text="the bumper is hit")
    state = f"{ROOT}/tel/safety/state"
    at_ns = BEGIN_NS + NS_PER_S
    summary.add(f"{ROOT}/tel/odom/health", "Health", health, BEGIN_NS, raw=False)
    summary.add(state, "SafetyState", samples.state(), BEGIN_NS, raw=False)
    summary.add(f"{ROOT}/evt/bridge", "Event", event, at_ns, raw=False)
    summary.add(state, "SafetyState", samples.state("contact"), at_ns, raw=False)
    summary.add(f"{ROOT}/tel/dashboard/health", "Health", health, at_ns, raw=False)
    assert summary.versions == {"odom": "1.2", "dashboard": "1.2"}  # by the key: rules go by it
    assert summary.events == [Note(1.0, "bridge", "error", "contact: the bumper is hit")]
    assert summary.latched == [Note(1.0, "safety", "error", "contact")]
