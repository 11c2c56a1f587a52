"""A recorded drive of ten seconds with one contact and one reset."""

from collections.abc import Iterator

from cli.recordings.timeline import Timeline
from common.freshness import NS_PER_S
from t2 import messages as m
from t2.messages import Command
from tests import factories
from tests.recorder.samples import BEGIN_NS, ROOT

HIT_S, RESET_S, END_S = 4.0, 7.0, 10.0
CONTACT = m.Cause(name="contact", action="brake", age=0.0, text="The bumper was hit.")

Arrival = tuple[str, str, m.Message, int]  # key, type, message, arrival time in ns


def drive() -> Iterator[Arrival]:
    """Yield all messages in the order of their arrival."""
    for seq in range(round(END_S * 20)):
        at_s = seq / 20
        held = HIT_S <= at_s < RESET_S
        for path, message in (
            ("@cmd/drive/teleop", m.Drive(seq=seq, boot=1, linear=0.5, angular=0.1, echo=1)),
            ("tel/safety/state", state(held)),
            ("@cmd/motion", m.Motion(command=Command.BRAKE if held else Command.RUN,
                                     linear=0.0 if held else 0.5)),
            ("tel/bridge/velocity", m.Velocity(seq=seq, boot=2, linear=0.4, angular=0.1)),
            ("tel/odom/odometry", factories.odometry(x=0.02 * seq, y=0.0)),
        ):  # fmt: skip
            yield at(path, message, at_s)
        if at_s == HIT_S:
            latched = m.Event(name="contact", level="error", text="The <b>bumper</b> was hit.")
            yield at("evt/safety", latched, at_s)
        if seq % 20 == 0:
            health = m.Health(service="bridge", version="0.1.0", uptime=at_s, rates={}, counters={},
                              lateness=0.0, rss=0)  # fmt: skip
            yield at("tel/bridge/health", health, at_s)


def in_the_map() -> Iterator[Arrival]:
    """Yield a used and a refused fix in two seconds of a pose in the map, which is lost then."""
    used, refused = 0, 0
    for step in range(21):
        if step in (5, 10):
            fix = m.Fix(x=step / 10, y=0.1, covariance=(0.01,) * 9, odom_boot=1, odom_seq=step)
            yield at("@cmd/fix/tags", fix, step / 10)
            used, refused = used + (step == 5), refused + (step == 10)
        sources = (factories.fix_state(used=used, refused=refused, in_a_row=refused),)
        pose = factories.map_pose("lost" if step > 15 else "placed", x=step / 10, sources=sources)
        yield at("tel/localization/pose", pose, step / 10 + 0.01)


def at(path: str, message: m.Message, at_s: float) -> Arrival:
    """Return a message with its arrival time, in seconds since the start."""
    return f"{ROOT}/{path}", type(message).__name__, message, BEGIN_NS + round(at_s * NS_PER_S)


def timeline_of(*arrivals: Arrival) -> Timeline:
    """Return the timeline of these messages."""
    timeline = Timeline()
    for arrival in arrivals:
        timeline.add(*arrival)
    return timeline


def state(held: bool) -> m.SafetyState:
    """Return a safety state: braked by a latched contact, or driving."""
    if not held:
        return factories.safety_state()
    return factories.safety_state(verdict="brake", latched=("contact",), causes=(CONTACT,))
