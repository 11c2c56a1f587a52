"""The picture of patrol: a short route, two rounds, and a person in the way."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from t2 import messages as m
from verification.patrol import picture
from verification.patrol.draw import Person, Scene


def short(scene: Scene) -> Scene:
    home = scene.route.points[0]
    return replace(
        scene,
        route=replace(scene.route, points=(home, m.RoutePoint(x=home.x + 3.0, y=home.y))),
        people=(Person(at=10.0, ahead=1.3, speed=0.0, seconds=8.0),),
    )


@pytest.mark.campaign
def test_the_command_draws_a_run_and_prints_what_it_did(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = short(picture.yard())
    monkeypatch.setattr(picture, "yard", lambda: scene)
    file = tmp_path / "patrol.png"
    assert picture.main([str(file), "--rounds", "2"]) == 0
    assert file.read_bytes().startswith(b"\x89PNG")
    printed = capsys.readouterr().out
    assert "2 of 2 rounds ended at home" in printed
    assert "waited 0 s" not in printed
