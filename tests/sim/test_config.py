import math
from pathlib import Path

import pytest

from common.config import DEFAULT_FILE, Sources, load
from common.errors import ConfigError
from common.settings import Vehicle
from sim.config import WORLDS, Config, Sim, load_plan, load_script
from sim.geometry import Pose, Rectangle
from sim.requests import Freeze
from sim.world import World

VEHICLE = Vehicle()
BODY = Rectangle(VEHICLE.length / 2, VEHICLE.width / 2)
TURNING = 0.66  # m around the middle, what the body sweeps on the spot


def written(folder: Path, text: str) -> str:
    file = folder / "file.toml"
    file.write_text(text, encoding="utf-8")
    return str(file)


@pytest.mark.parametrize("name", [file.stem for file in WORLDS.glob("*.toml")])
def test_every_shipped_world_can_be_started_in(name: str) -> None:
    assert load_plan(name, VEHICLE).title


def test_the_office_has_odometry_s_coordinates() -> None:
    assert load_plan("office", VEHICLE).start.pose == Pose(0.0, 0.0, 0.0)


def test_the_office_s_route_can_be_stood_on() -> None:
    plan = load_plan("office", VEHICLE)
    world = World.of(plan)
    assert len(plan.route) >= 4
    for spot in plan.route:
        assert world.contact(BODY, spot.pose) is (spot.name == "step")
        touching = Pose(spot.x, spot.y - 1e-4, spot.heading)
        assert not world.blocks(BODY, touching), spot.name


@pytest.mark.parametrize("name", ["corner", "clear of the step", "home"])
def test_the_office_has_room_to_turn(name: str) -> None:
    plan = load_plan("office", VEHICLE)
    (spot,) = (spot for spot in plan.route if spot.name == name)
    assert World.of(plan).clearance(Rectangle(0.01, 0.01), spot.pose) > TURNING + 0.2


def test_the_office_s_step_is_met_before_anything_that_sonar_sees() -> None:
    plan = load_plan("office", VEHICLE)
    (spot,) = (spot for spot in plan.route if spot.name == "step")
    assert World.of(plan).clearance(BODY, spot.pose) > 0.9
    assert spot.heading == pytest.approx(math.pi / 2, abs=1e-4)


def test_a_world_may_be_a_file_anywhere(tmp_path: Path) -> None:
    assert load_plan(written(tmp_path, 'title = "mine"'), VEHICLE).title == "mine"


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("title = ", "is no TOML"),
        ("title = 3", r"Expected `str`.*title"),
        ('title = "x"\nwall = []', "unknown field `wall`"),
        (
            'title = "x"\nboxes = [{name = "b", x = 0, y = 0, length = 3, width = 3}]',
            "stands in a wall or a box",
        ),
    ],
)
def test_a_wrong_world_is_refused_with_its_file(tmp_path: Path, text: str, error: str) -> None:
    with pytest.raises(ConfigError, match=rf"(?s)file\.toml.*{error}"):
        load_plan(written(tmp_path, text), VEHICLE)


def test_an_unknown_world_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"sim.world = 'moon'.*empty, office"):
        load_plan("moon", VEHICLE)


def test_a_script_is_read(tmp_path: Path) -> None:
    text = '[[steps]]\nat = 2\nrequest = { do = "freeze", seconds = 0.5 }'
    (step,) = load_script(Path(written(tmp_path, text))).steps
    assert (step.at, step.request) == (2.0, Freeze(seconds=0.5))


def test_a_missing_script_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read"):
        load_script(tmp_path / "none.toml")


def test_the_shipped_settings_are_the_defaults() -> None:
    assert load(Config, Sources((DEFAULT_FILE,), environ={})).config.sim == Sim()
