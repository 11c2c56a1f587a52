"""The pictures around a latch, and in the report."""

import re
from pathlib import Path

import pytest

from cli.__main__ import main
from cli.recordings.latch_pictures import AFTER, BEFORE, LATCHES_MAX, LatchPictures
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.writer import RecordingWriter
from t2 import messages as m
from tests.factories import safety_state
from tests.recorder.samples import sample

JPEG = b"\xff\xd8picture\xff\xd9"
KEY = "tel/camera/front/picture"


def picture(jpeg: bytes = JPEG) -> m.Picture:
    return m.Picture(width=2, height=2, jpeg=jpeg)


def state(*latched: m.CauseName) -> m.SafetyState:
    return safety_state(latched=latched)


def test_the_last_pictures_before_a_latch_and_the_first_ones_after_it() -> None:
    it = LatchPictures()
    it.add(state(), "state", 0.0)
    for at in range(60):
        it.add(picture(), f"t2/v1/001/{KEY}", at / 2)
        if at == 40:
            it.add(state("contact"), "state", at / 2)
    (latch,) = it.latches
    assert (latch.at_s, latch.causes) == (20.0, ("contact",))
    apart = [text for text, _ in latch.shown]
    assert len(apart) == BEFORE + AFTER
    assert (apart[0], apart[BEFORE - 1], apart[BEFORE], apart[-1]) == (
        "-2.5 s", "+0.0 s", "+0.5 s", "+2.0 s",
    )  # fmt: skip
    assert {one.camera for one in latch.pictures} == {"front"}


def test_what_is_latched_at_the_start_and_what_is_no_jpeg_has_no_pictures() -> None:
    it = LatchPictures()
    it.add(picture(), KEY, 0.0)
    it.add(state("estop"), "state", 0.1)
    assert it.latches == []
    it.add(picture(b"<script>"), KEY, 0.2)
    it.add(state("estop", "contact"), "state", 0.3)
    assert [len(one.pictures) for one in it.latches] == [1]
    for at in range(2 * LATCHES_MAX):
        it.add(state(), "state", 1.0 + at)
        it.add(state("estop"), "state", 1.5 + at)
    assert len(it.latches) == LATCHES_MAX


def test_the_report_shows_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = RecordingWriter(tmp_path / "latch.mcap", Encoder(Vehicle()))
    for at, message in ((0.0, state()), (0.5, picture()), (1.0, state("contact"))):
        made.write(
            sample(KEY if isinstance(message, m.Picture) else "tel/safety/state", message, at)
        )
    made.close()
    assert main(["report", str(made.path)]) == 0
    text = Path(capsys.readouterr().out.strip()).read_text()
    assert "Pictures at latches" in text
    assert "-0.5 s front" in text
    assert re.findall(r'src="data:image/jpeg;base64,[A-Za-z0-9+/=]+"', text)
    assert "img-src data:" in text
