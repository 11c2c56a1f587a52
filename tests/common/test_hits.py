"""One row for one press of the bumper."""

from common.hits import HIT_NS, Hits
from t2.messages import Event


def contact(mono_ns: int, host: int = 1) -> Event:
    return Event(name="contact", level="error", text="", host=host, mono_ns=mono_ns)


def test_one_press_is_shown_once_whichever_event_comes_first() -> None:
    for first, second in (("bridge", "safety"), ("safety", "bridge")):
        hits = Hits()
        assert not hits.is_repeat(first, contact(HIT_NS))
        assert hits.is_repeat(second, contact(0))
        assert not hits.is_repeat(second, contact(1))  # the next press


def test_other_events_are_shown() -> None:
    hits = Hits()
    assert not hits.is_repeat("bridge", contact(0))
    assert not hits.is_repeat("bridge", contact(1))  # pressed again
    assert not hits.is_repeat("safety", contact(HIT_NS + 2))  # later
    assert not hits.is_repeat("safety", contact(0, host=2))  # another computer
    assert not hits.is_repeat("safety", Event(name="estop", level="error", text="", host=1))
