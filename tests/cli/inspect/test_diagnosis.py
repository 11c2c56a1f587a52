"""Diagnosis of an observation, from the laptop to the wheels."""

from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest

from cli.inspect import diagnosis as d
from cli.inspect.diagnosis import Observation, diagnose
from cli.inspect.findings import REMEDIES, REMEDY, TEXTS, Finding
from common.root_cause import FROM_LINK
from services.safety.core.causes import BY_NAME
from t2 import keys
from t2 import messages as m
from t2.catalogue import CAUSES
from t2.words import PLACEHOLDER
from tests import factories
from tests.factories import health

RUNNING = (*keys.ON_BOARD, "recorder", *d.OPTIONAL)  # on a healthy robot
RATES = {topic.path: topic.rate_hz for topic in d.STREAMS}
Check = Callable[[Observation], Iterator[Finding]]


def link(state: Any = "up", **given: Any) -> m.Link:
    return factories.link(state=state, **given)


def relay(state: Any = "up", **given: Any) -> m.Link:
    usual: dict[str, Any] = {"version": "0.1.0", "braking": "", "uptime": 60.0, "counters": {}}
    return link(relay=m.Relay(state=state, **(usual | given)))


def state(*names: Any, latched: tuple[Any, ...] = (), **given: Any) -> m.SafetyState:
    causes = tuple(
        m.Cause(
            name=name,
            action=BY_NAME[name].action if name in BY_NAME else "stop",
            age=1.0,
            text=CAUSES[name].text[0] if name in CAUSES else name,
            phrases=(m.Phrase(name),),
        )
        for name in names
    )
    return factories.safety_state(verdict="stop", latched=latched, causes=causes, **given)


def seen(**given: Any) -> Observation:
    """Return the observation of a healthy robot, with the given differences."""
    healthy: dict[str, Any] = {
        "t2": "0.1.0", "instances": dict.fromkeys(RUNNING, 1),
        "sources": ["teleop", "web"], "calls": ["safety/reset"],
        "healths": {name: health(name) for name in RUNNING}, "links": [link()],
        "state": state("no_request"), "delays_s": [0.01, 0.02], "rates": RATES,
        "pose": factories.map_pose(),
    }  # fmt: skip
    return Observation(**(healthy | given))


def problems(observed: Observation) -> list[tuple[str, str, str]]:
    """Return level, text and remedy of all findings that are not ok."""
    found = diagnose(observed, "001")
    return [(each.level, each.text(), each.todo()) for each in found if each.level != "ok"]


def remedy(name: str) -> str:
    """Return a remedy in English."""
    return REMEDIES[name][0]


def of_cause(name: Any) -> str:
    """Return the remedy of a cause in English."""
    return CAUSES[name].remedy[0]


def test_a_healthy_robot() -> None:
    assert problems(seen()) == []
    assert problems(seen(state=state())) == []


def test_services_that_are_missing_duplicate_hanging_or_late() -> None:
    given = health("safety"), health("odom", lateness=0.3), health("teleop")
    instances = {"safety": 2, "odom": 1, "mine": 1, "teleop": 2, "patrol": 2}
    observed = seen(instances=instances, healths={each.service: each for each in given})
    found = {each.text().split()[0]: each for each in d.services(observed)}
    assert {name: each.level for name, each in found.items()} == {
        "bridge": "wrong", "safety": "wrong", "odom": "note", "mine": "wrong", "patrol": "wrong",
        "teleop": "ok",  # any number of a tool may run
    }  # fmt: skip


@pytest.mark.parametrize(
    ("running", "named"),
    [
        ((), ["nothing is recorded, and the shift log has a gap", "patrol, camera"]),
        (("recorder", "camera"), ["patrol"]),
        (("recorder", *d.OPTIONAL), []),
    ],
)
def test_optional_services_that_do_not_run_are_named(
    running: tuple[str, ...], named: list[str]
) -> None:
    """One that hangs leaves the bus, and its own line with it."""
    names = (*keys.ON_BOARD, *running)
    observed = seen(instances=dict.fromkeys(names, 1), healths={it: health(it) for it in names})
    assert [each.text().partition(": ")[2] for each in d.optional(observed)] == named
    observed.listed = False
    assert list(d.optional(observed)) == []


@pytest.mark.parametrize(
    ("check", "given", "expected"),
    [
        (d.versions, {"healths": {"bridge": health("bridge", version="0")}},
         [("note", "bridge is T2 0, this laptop 0.1.0")]),
        (d.versions, {"undecodable": {"tel/x": "not a Bumper"}},
         [("ok", "everywhere"), ("wrong", "tel/x: not a Bumper")]),
        (d.rights, {}, [("ok", "may read; drive as teleop, web; call safety/reset")]),
        (d.rights, {"sources": [], "calls": []}, [("note", "may only read")]),
        (d.rights, {"sources": [], "calls": [], "may_stop": True}, [("note", "read and stop")]),
        (d.rights, {"sources": None}, [("unknown", "require safety")]),
        (d.rights, {"instances": {}}, [("unknown", "no service found")]),
        (d.clock, {"delays_s": []}, [("unknown", "no message arrived")]),
        (d.clock, {"delays_s": [5.0]}, [("note", "5.0 s ahead of")]),
        (d.clock, {"delays_s": [-5.0]}, [("note", "5.0 s behind")]),
        (d.clock, {"delays_s": [0.0, 0.3]}, [("note", "0.30 s longer"), ("ok", "agree to 0 ms")]),
    ],
)  # fmt: skip
def test_checks(check: Check, given: dict[str, Any], expected: list[tuple[str, str]]) -> None:
    found = list(check(seen(**given)))
    assert [each.level for each in found] == [level for level, _ in expected]
    for each, (_, phrase) in zip(found, expected, strict=True):
        assert phrase in each.text()


HIT = {"latched": ("contact",)}
REJECTED = [
    link(rejected={"bad_crc": 4, "no_magic": 1}, send_errors=4),
    link(rejected={"bad_crc": 9, "no_magic": 1}, send_errors=7),
]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"listed": False, "instances": {"odom": 1}},
         [("unknown", "safety, bridge are perhaps running: the router did not list the services "
           "in time", "")]),
        ({"links": [link(armed=False, waiting="link lost")]},
         [("note", "the bridge accepts no motion now: link lost", "")]),
        ({"links": REJECTED}, [
            ("note", "the bridge rejects frames of the board: 5 bad_crc", remedy("frames")),
            ("wrong", "the system failed to send 3 datagrams to the board", remedy("unsent"))]),
        ({"links": [link(armed=False)], "state": state("unarmed")},
         [("wrong", "The bridge is not armed yet. (stop)", of_cause("unarmed"))]),
        ({"links": [relay("never", version="")]},
         [("wrong", "no report of the relay received", remedy("relay"))]),
        ({"links": [relay(braking="silent")]},
         [("wrong", "the relay sends BRAKE: silent", remedy("relay.silent"))]),
        ({"links": [relay(version="2")]},
         [("note", "the relay is T2 2, this laptop 0.1.0", remedy("relay_copy"))]),
        ({"state": state("contact", "neutral", **HIT)}, [
            ("wrong", "The bumper was hit. (brake, latched)", of_cause("contact")),
            ("note", "Let go of the controls, then drive. (stop)",
             of_cause("neutral"))]),
        ({"state": state("contact", release=factories.release(left=0.0), **HIT)},
         [("wrong", "The bumper was hit. (brake, latched)", remedy("by_hand"))]),
        ({"links": [link("lost")], "state": state("bumper", "contact", **HIT)}, [
            ("wrong", "the board at 10.7.5.224:4002 is silent", remedy("board_lost")),
            ("unknown", "no data without the board", ""),
            ("note", "follows from the above: The bumper is not being read.", ""),
            ("wrong", "The bumper was hit. (brake, latched)", of_cause("contact"))]),
        ({"state": state("smoke", latched=("smoke",))},  # of another version, with its own text
         [("wrong", "smoke (stop, latched)", remedy("reset"))]),
    ],
)  # fmt: skip
def test_problems(given: dict[str, Any], expected: list[tuple[str, str, str]]) -> None:
    assert problems(seen(**given)) == expected


FAR = {"text": "", "phrases": (m.Phrase("fix.far", {"sigmas": 9.0}),), "used": 0, "refused": 5}
REFUSED = "tags: 5 fixes in a row refused: It is 9.0 standard deviations from the pose."


def fixes(state: Any = "placed", **given: Any) -> m.MapPose:
    """Return a pose in the map with one source of fixes."""
    return factories.map_pose(state, sources=(factories.fix_state(**given),))


@pytest.mark.parametrize(
    ("pose", "expected"),
    [
        (None, [("note", "localization is not running: only driving in the map needs it",
                 remedy("localization"))]),
        (factories.map_pose("unplaced"),
         [("note", "The position is not known: place the vehicle (`t2 call localization/place`).",
           remedy("place"))]),
        (factories.map_pose("lost"),
         [("wrong", "The position is lost: it is known only to 0.20 m and 3 degrees. Place the "
           "vehicle (`t2 call localization/place`), or wait for fixes.", remedy("place"))]),
        (fixes(age=None), [("note", "tags: no fix was received",
                            remedy("fixes").format(source="tags"))]),
        (fixes(age=11.0), [("note", "tags: no fix for 11 s",
                            remedy("fixes").format(source="tags"))]),
        (fixes(in_a_row=4, **FAR), [("note", REFUSED.replace("5", "4"), "")]),
        (fixes(in_a_row=5, **FAR), [("wrong", REFUSED, "")]),
        (fixes("unplaced", in_a_row=5, **FAR), [  # which follows from the vehicle's own state
            ("note", "The position is not known: place the vehicle (`t2 call localization/place`).",
             remedy("place")), ("note", REFUSED, "")]),
    ],
)  # fmt: skip
def test_the_pose_in_the_map(pose: Any, expected: list[tuple[str, str, str]]) -> None:
    assert problems(seen(pose=pose)) == expected


def test_a_placed_vehicle_and_its_fixes_in_both_languages() -> None:
    position, source = d.localization(seen(pose=fixes()))
    assert (position.level, source.level) == ("ok", "ok")
    assert "known to 0.20 m and 3 degrees" in position.text()
    assert source.text() == "tags: 5 fixes used, 1 refused"
    assert source.text("zh") == "tags：已采用 5 次定位修正，拒绝 1 次"


def test_a_localization_without_a_pose_is_no_second_problem() -> None:
    running = dict.fromkeys((*keys.ON_BOARD, "localization"), 1)
    (one,) = d.localization(seen(pose=None, instances=running))
    assert (one.level, one.text()) == ("unknown", "localization publishes no pose")
    assert not [*d.localization(seen(pose=None, rates=RATES | {keys.ODOMETRY.path: 0.0}))]


def without(*services: str) -> dict[str, Any]:
    """Return instances and healths without these services."""
    names = [name for name in RUNNING if name not in services]
    return {"instances": dict.fromkeys(names, 1), "healths": {n: health(n) for n in names}}


STOPPED = {"rates": {"tel/bridge/link": 10.0}, "state": state("no_request", *FROM_LINK)}


@pytest.mark.parametrize(
    ("given", "problem", "remedy"),
    [
        (without("bridge") | STOPPED | {"links": []}, "bridge is not running", remedy("start")),
        ({"healths": without("bridge")["healths"], "links": [], **STOPPED},
         "bridge is running and publishes no health: it hangs", remedy("hangs")),
        (STOPPED | {"links": [link("never")]}, "no frame received from the board",
         remedy("link_never")),
        (STOPPED | {"links": [msgspec.structs.replace(relay("lost"), state="lost")]},
         "the relay is silent", remedy("relay")),
        ({"rates": RATES | {"tel/bridge/bumper": 0.0}, "state": state("bumper", "silent")},
         "tel/bridge/bumper has 0 of 50 Hz", remedy("silent")),
        (without("odom") | {"rates": RATES | {keys.ODOMETRY.path: 0.0}},
         "odom is not running", remedy("start")),
        (without("safety") | {"state": None, "sources": None}, "safety is not running",
         remedy("start")),
        ({"rates": {}, "healths": {}, "links": [], "state": None},
         "services run, but no message arrives", remedy("no_message")),
        ({"stranger": "driver.bob", "instances": {}}, "this router does not know driver.bob",
         remedy("stranger")),
        ({"instances": {}, "others": ["002", "berlin-2"]},
         "no service of robot 001 is here; the router knows 002, berlin-2", remedy("robot")),
    ],
)  # fmt: skip
def test_one_cause_is_one_problem(given: dict[str, Any], problem: str, remedy: str) -> None:
    wrong = [(text, todo) for level, text, todo in problems(seen(**given)) if level == "wrong"]
    assert len(wrong) == 1, wrong
    assert wrong[0][0].startswith(problem)
    assert wrong[0][1] == remedy


def test_streams_that_are_slow_missing_or_downsampled() -> None:
    sent_hz = {f"t2/v1/001/{path}": hz for path, hz in RATES.items() if "mileage" not in path}
    rates = RATES | {
        "tel/bridge/bumper": 0.0, "tel/bridge/mileage": 12.0, "tel/bridge/velocity": 10.0,
    }  # fmt: skip
    observed = seen(rates=rates)
    observed.healths["bridge"] = health("bridge", rates=sent_hz)
    assert [text for _, text, _ in problems(observed)] == [
        "tel/bridge/mileage has 12 of 25 Hz",
        "tel/bridge/bumper is sent with 50 Hz and does not arrive here",
    ]  # the velocity is downsampled for this laptop


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ({"rates": RATES | {"tel/bridge/mileage": 0.0}}, {"bumper", "sonar", "switches"}),
        ({"rates": RATES | {"tel/bridge/bumper": 0.0}}, {"sonar", "switches"}),
        ({"rates": RATES | {"tel/bridge/ultrasonic": 0.0}}, {"bumper", "switches"}),
        ({"links": [link(), link(send_errors=1)]}, {"bumper", "sonar", "switches"}),
    ],
)
def test_only_what_follows_is_folded(given: dict[str, Any], kept: set[str]) -> None:
    found = problems(seen(state=state("bumper", "sonar", "switches"), **given))
    texts = {entry.text[0]: name for name, entry in CAUSES.items()}
    shown = {text.rpartition(" (")[0] for _, text, _ in found}
    assert {name for text, name in texts.items() if text in shown} == kept


def test_normal_causes_exist() -> None:
    assert CAUSES.keys() >= {*d.NORMAL}


def test_both_languages_have_the_same_fields() -> None:
    for english, chinese in TEXTS.values():
        assert sorted(PLACEHOLDER.findall(english)) == sorted(PLACEHOLDER.findall(chinese)), english


def round_(state: m.RoundState, name: str = "patrol.idle", left: float = 9.0) -> m.PatrolState:
    return m.PatrolState(state=state, text="?", phrases=(m.Phrase(name),), left=left)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, []),
        ({"patrol": round_("driving"), "obeys_patrol": True}, []),
        ({"patrol": round_("idle")}, []),  # the settings are not known
        ({"patrol": round_("idle"), "obeys_patrol": False}, [
            ("note", "safety does not obey patrol: no round can move the vehicle",
             remedy("patrol_source"))]),
        ({"patrol": round_("stopped", "patrol.restarted")},
         [("wrong", "Patrol has restarted during the round.", "")]),
        ({"patrol": round_("waiting", "patrol.waiting")}, []),
        ({"patrol": round_("waiting", "patrol.waiting", 0.0)},
         [("note", "Waiting: it goes on by itself when the way is free.", "")]),
    ],
)  # fmt: skip
def test_rounds(given: dict[str, Any], expected: list[tuple[str, str, str]]) -> None:
    assert problems(seen(**given)) == expected


def test_cameras() -> None:
    lost = m.Phrase("event.camera_lost", {"camera": "rear", "reason": "refused"})
    cameras = {
        "rear": m.Camera(camera="rear", state="lost", text="?", phrases=(lost,)),
        "front": m.Camera(camera="front", state="up", text="Pictures arrive."),
    }
    assert problems(seen(cameras=cameras)) == [
        ("wrong", "Camera rear: no picture. refused", TEXTS[f"{REMEDY}camera_lost"][0])
    ]
    ok = [it.text() for it in diagnose(seen(cameras=cameras), "001") if it.where == "camera"]
    assert ok == ["Pictures arrive.", "Camera rear: no picture. refused"]
    boots = {"rear": {1}, "front": {1, 2}}
    (twice, _) = problems(seen(cameras=cameras, camera_boots=boots))
    assert twice == (
        "wrong", "camera front: two programs publish pictures under this name",
        remedy("camera_twice"),
    )  # fmt: skip
