"""Pictures to browsers: at the pace and in the size of each link."""

from collections.abc import Collection
from typing import Any

import msgspec
import pytest

from common import clock
from common.freshness import NS_PER_S
from services.dashboard.pictures import FIRST, QUICK, WIDTHS, Pictures
from services.dashboard.telemetry_cache import TelemetryCache
from t2 import keys
from t2 import messages as m
from tests.factories import safety_state
from tests.fake_bus import FakeBus

JPEG = b"\xff\xd8picture\xff\xd9"
MS = NS_PER_S // 1000


class Fixture:
    """Pictures on a fake bus, with a clock that a test sets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns, self.bus, self.telemetry = NS_PER_S, FakeBus(), TelemetryCache()
        self.sent: list[tuple[list[str], bytes]] = []
        monkeypatch.setattr(clock, "now_ns", lambda: self.now_ns)
        self.pictures = Pictures(self.bus, self.telemetry, self._send)

    def _send(self, viewers: Collection[str], message: bytes) -> None:
        self.sent.append((list(viewers), message))

    def camera(self, name: str = "front", state: m.CameraState = "up") -> None:
        """Deliver the state of a camera."""
        message = m.Camera(camera=name, state=state, text="text")
        declared = keys.CAMERA.on("001", camera="*")
        self.bus.deliver(keys.CAMERA, message, self.now_ns, declared, camera=name)

    def watch(self, viewer: str = "1", camera: str = "front", after_s: float = 0.0) -> None:
        """Let a browser ask for a picture, this time after the last one was sent."""
        self.now_ns += round(after_s * NS_PER_S)
        self.pictures.watch(viewer, camera, self.now_ns)

    def answer(
        self, jpeg: bytes = JPEG, seq: int = 1, heartbeat: int | None = 5, safety_boot: int = 0
    ) -> None:
        """Answer the last call of a camera."""
        self.bus.answers[-1][0](
            m.Picture(
                boot=2**62, seq=seq, heartbeat=heartbeat, safety_boot=safety_boot,
                width=1, height=1, jpeg=jpeg,
            )
        )  # fmt: skip

    @property
    def request(self) -> Any:
        return self.bus.asked[-1][1]

    def header(self) -> dict[str, Any]:
        """Return the header of the last picture that was sent."""
        message = self.sent[-1][1]
        length = int.from_bytes(message[-2:], "big")
        assert message.startswith(JPEG)
        assert len(message) == len(JPEG) + length + 2
        header: dict[str, Any] = msgspec.json.decode(message[-2 - length : -2])
        return header


@pytest.fixture
def it(monkeypatch: pytest.MonkeyPatch) -> Fixture:
    it = Fixture(monkeypatch)
    it.camera()
    return it


def test_one_picture_is_on_its_way(it: Fixture) -> None:
    it.watch()
    assert (it.request.camera, it.request.width) == ("front", WIDTHS[FIRST])
    it.pictures.tick()
    it.watch()  # a second question changes nothing
    assert len(it.bus.asked) == 1
    it.answer(seq=7)
    assert it.sent[0][0] == ["1"]
    assert len(it.bus.asked) == 1  # until the browser shows it
    it.watch(after_s=0.1)
    assert (it.request.boot, it.request.seq) == (2**62, 7)


def test_the_header_has_the_age_of_its_heartbeat(it: Fixture) -> None:
    state = safety_state(heartbeat=5)
    it.telemetry.update("tel/safety/state", state, it.now_ns)
    it.watch(after_s=0.25)
    it.answer()
    expected = {"camera": "front", "boot": str(2**62), "seq": 1, "heartbeat": 5, "age": 0.25}
    assert it.header() == expected
    for heartbeat in (4, None):  # not known here; a file
        it.watch()
        it.answer(seq=2, heartbeat=heartbeat)
        assert (it.header()["heartbeat"], it.header()["age"]) == (heartbeat, None)


def test_only_pictures_that_were_sent_to_a_browser_can_be_answered_by_it(it: Fixture) -> None:
    it.watch("1")
    it.answer()
    it.watch("2")
    assert it.pictures.has_sent("1", 5)
    assert not it.pictures.has_sent("1", 6)
    assert not it.pictures.has_sent("2", 5)
    assert not it.pictures.has_sent("3", 5)
    it.pictures.leave("1")
    assert not it.pictures.has_sent("1", 5)


@pytest.mark.parametrize("jpeg", [b"", JPEG[:-2], JPEG[2:], b"junk"])
def test_a_picture_that_is_not_whole_is_not_sent(it: Fixture, jpeg: bytes) -> None:
    it.watch()
    it.answer(jpeg)
    assert it.sent == []
    it.pictures.tick()
    assert len(it.bus.asked) == 2  # the next one
    it.answer()
    assert len(it.sent) == 1


def test_a_camera_that_does_not_answer_is_asked_again(it: Fixture) -> None:
    it.watch()
    it.bus.answers[-1][1](m.Refusal(text="no answer"))
    assert len(it.bus.asked) == 1
    it.pictures.tick()
    assert len(it.bus.asked) == 2


def test_browsers_with_the_same_width_share_a_picture(it: Fixture) -> None:
    it.watch("1")
    it.watch("2")
    assert len(it.bus.asked) == 1
    it.answer()
    assert it.sent[0][0] == ["1", "2"]


def test_a_slow_link_gets_smaller_pictures_and_a_quick_one_larger(it: Fixture) -> None:
    for level in (FIRST, FIRST - 1, FIRST - 2, FIRST - 3, 0, 0):
        it.watch(after_s=0.2)
        assert it.request.width == WIDTHS[level]
        it.answer()
    for _ in range(QUICK - 1):
        it.watch(after_s=0.02)
        assert it.request.width == WIDTHS[0]
        it.answer()
    it.watch(after_s=0.02)
    assert it.request.width == WIDTHS[1]


@pytest.mark.parametrize(
    ("heartbeat", "safety_boot", "age_s"),
    [(None, 7, None), (100, 7, 0.5), (101, 7, 0.0), (125, 7, 0.0), (126, 7, None), (99, 7, None),
     (101, 8, None)],
)  # fmt: skip
def test_the_age_of_a_picture(
    it: Fixture, heartbeat: int | None, safety_boot: int, age_s: float | None
) -> None:
    """A picture may overtake the state of safety that it carries."""
    state = safety_state(heartbeat=100, boot=7)
    it.telemetry.update(keys.SAFETY.path, state, it.now_ns - NS_PER_S // 2)
    it.watch()
    it.answer(heartbeat=heartbeat, safety_boot=safety_boot)
    assert it.header()["age"] == age_s


def test_a_change_of_the_camera(it: Fixture) -> None:
    it.watch()
    it.camera("rear")
    it.watch(camera="rear")
    assert it.request.camera == "rear"
    it.watch(camera="none")  # there is no such one
    assert len(it.bus.asked) == 2


def test_the_list_of_cameras(it: Fixture) -> None:
    assert it.pictures.has_camera
    it.now_ns += 2 * NS_PER_S
    it.camera("rear", "frozen")
    it.now_ns += 2 * NS_PER_S
    found = [(one.name, one.state, one.text.en) for one in it.pictures.views(it.now_ns)]
    assert found == [
        ("front", "lost", "No message of the robot arrives."),
        ("rear", "frozen", "text"),
    ]
    it.telemetry.update(keys.SAFETY.path, safety_state(), it.now_ns)
    assert it.pictures.views(it.now_ns)[0].text.en == "The camera's service is not running."
    for n in range(20):
        it.camera(f"more{n}")
    assert len(it.pictures.views(it.now_ns)) == 8
