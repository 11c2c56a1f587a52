from pathlib import Path

import pytest

from cli.settings import Everything
from common.config import Sources, load
from common.errors import ConfigError
from common.settings import Vehicle, Wire
from common.wire import commands as c
from sim.config import (
    IDEAL,
    known_profiles,
    load_model,
    load_plan,
    read_profile,
)
from sim.model import Model
from tests.sim.sim_fixture import SimFixture

PERIOD_S, REQUESTS = 0.05, 80
STRAIGHT_M = 0.4 * PERIOD_S * REQUESTS  # without any acceleration


def written(folder: Path, text: str, name: str = "file") -> str:
    file = folder / f"{name}.toml"
    file.write_text(text, encoding="utf-8")
    return str(file)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("wall = []", "unknown field `wall`"),
        ("walls = [{points = [[0, 0], [0, nan]]}]", "float"),
        (
            'boxes = [{name = "b", x = 0, y = 0, length = 3, width = 3}]',
            "stands in a wall or a box",
        ),
    ],
)
def test_a_wrong_world_is_refused_with_its_file(tmp_path: Path, text: str, error: str) -> None:
    with pytest.raises(ConfigError, match=rf"(?s)file\.toml.*{error}"):
        load_plan(written(tmp_path, f'title = "x"\n{text}'), Vehicle())


# --- profiles -----------------------------------------------------------------------------------


def profile(folder: Path, text: str) -> str:
    return written(folder, f'title = "a"\nsource = "b"\n{text}', "mine")


@pytest.mark.parametrize("name", known_profiles())
def test_each_profile_changes_the_vehicle_which_still_drives_and_brakes(name: str) -> None:
    vehicle = load_model([name])
    assert vehicle != IDEAL
    load(Everything, Sources(environ={}, sets=read_profile(name).stack.split()))
    sim = SimFixture(vehicle=vehicle)
    for _ in range(REQUESTS):
        sim.run(0.4)
        sim.say(c.BumperQuery(), c.DistanceQuery(), c.UltrasonicQuery())
        sim.after(PERIOD_S)
    assert 0.8 * STRAIGHT_M < sim.truth.distance < STRAIGHT_M
    for _ in range(10):  # one of them may be lost
        sim.say(c.MotionCommand(c.MotionKind.BREAK))
        sim.after(0.1)
    assert (sim.truth.linear, sim.truth.angular) == (0.0, 0.0)


def test_several_profiles_add_up_over_the_settings() -> None:
    given = Model(wire=Wire(feedback_angular_unit="milliradian"), vehicle=Vehicle(length=2.0))
    vehicle = load_model(["short-sonar", "centimetre-sonar", "unlike-units"], given)
    assert (vehicle.sonar.saturation, vehicle.sonar.quantum) == (3.0, 0.01)
    assert vehicle.wire.command_angular_unit == "milliradian"
    assert vehicle.vehicle == given.vehicle
    assert load_model([], given) == given


def test_two_profiles_that_contradict_are_refused(tmp_path: Path) -> None:
    steep = profile(tmp_path, "[drive]\nslope = 0.2")
    with pytest.raises(ConfigError, match=r"mine.*: drive\.slope = 0\.2, but profile slope"):
        load_model(["slope", steep])
    assert load_model(["slope", "slope"]) == load_model(["slope"])


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("[drive]\nslop = 0.1", r"profile .*mine\.toml: drive\.slop: unknown; did you"),
        ("[drive]\ncoast = 0", r"mine\.toml: drive\.coast = 0: Expected .*; allowed is 0\.01\.\."),
        ("stack = 1", r"mine\.toml: Expected `str`, got `int` - at `\$\.stack`"),
    ],
)
def test_a_wrong_profile_is_refused_with_its_name(tmp_path: Path, text: str, error: str) -> None:
    with pytest.raises(ConfigError, match=error):
        load_model([profile(tmp_path, text)])
