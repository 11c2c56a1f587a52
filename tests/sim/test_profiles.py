"""Every profile can be read, changes the vehicle, and lets it drive a straight line."""

from pathlib import Path

import pytest

from cli.settings import Everything
from common.config import Sources, load
from common.errors import ConfigError
from common.wire import commands as c
from sim.config import Config
from sim.profiles import Profile, known, listing, read, tables
from sim.world import Plan
from tests.sim.sim_fixture import SimFixture

KIND = load(Config, Sources(environ={})).config
OPEN = Plan(title="nothing")
PERIOD_S, REQUESTS = 0.05, 80
STRAIGHT_M = 0.4 * PERIOD_S * REQUESTS  # without any acceleration


def unkind(*names: str) -> Config:
    return load(Config, Sources(environ={}, tables=tables(names))).config


def written(folder: Path, name: str, text: str) -> str:
    file = folder / f"{name}.toml"
    file.write_text(f'title = "a"\nsource = "b"\n{text}', encoding="utf-8")
    return str(file)


@pytest.mark.parametrize("name", known())
def test_each_changes_the_vehicle_and_names_its_reason(name: str) -> None:
    config = unkind(name)
    assert (config.sim, config.wire) != (KIND.sim, KIND.wire)
    profile = read(name)
    assert len(profile.title) < 90
    assert len(profile.source) > 60
    load(Everything, Sources(environ={}, sets=profile.stack.split()))


@pytest.mark.parametrize("name", known())
def test_each_drives_a_straight_line_and_brakes(name: str) -> None:
    sim = SimFixture(OPEN, unkind(name))
    for _ in range(REQUESTS):
        sim.run(0.4)
        sim.say(c.BumperQuery(), c.DistanceQuery(), c.UltrasonicQuery())
        sim.after(PERIOD_S)
    assert 0.8 * STRAIGHT_M < sim.truth.distance < STRAIGHT_M
    for _ in range(10):  # one of them may be lost
        sim.say(c.MotionCommand(c.MotionKind.BREAK))
        sim.after(0.1)
    assert (sim.truth.linear, sim.truth.angular) == (0.0, 0.0)


def test_several_add_up_and_the_same_seed_gives_the_same() -> None:
    config = unkind("short-sonar", "centimetre-sonar", "lossy-port")
    assert (config.sim.sonar.saturation, config.sim.sonar.quantum) == (3.0, 0.01)
    runs = []
    for _ in range(2):
        sim = SimFixture(OPEN, config)
        sim.run(0.4)
        sim.after(2.0)
        runs.append(sim.datagrams)
    assert runs[0] == runs[1]
    assert 170 < len(runs[0]) < 200  # of 200, one of twenty on one port is lost


def test_what_is_set_by_hand_wins_over_a_profile() -> None:
    given = Sources(environ={}, sets=["sim.drive.slope=0.1"], tables=tables(["slope"]))
    assert load(Config, given).config.sim.drive.slope == 0.1


def test_two_that_contradict_are_refused(tmp_path: Path) -> None:
    steep = written(tmp_path, "steep", "[sim.drive]\nslope = 0.2")
    with pytest.raises(ConfigError, match=r"steep.*sim\.drive\.slope = 0\.2, but profile slope"):
        tables(["slope", steep])
    assert len(tables(["slope", "slope"])) == 2


def test_an_unknown_one_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"--profile moon: no such file.*short-sonar, slope"):
        tables(["moon"])


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (
            "[sim.drive]\nslop = 0.1",
            r"profile .*bad\.toml: sim\.drive\.slop: unknown; did you",
        ),
        ("[safety]\nmargin = 0.1", r"bad\.toml: Object contains unknown field `safety`"),
        ("[sim]\ndrive = 1", r"profile .*bad\.toml: sim\.drive = 1: Expected `object`"),
    ],
)
def test_a_wrong_one_is_refused_with_its_name(tmp_path: Path, text: str, error: str) -> None:
    with pytest.raises(ConfigError, match=error):
        unkind(written(tmp_path, "bad", text))


def test_the_list_has_each_title_and_what_the_services_need() -> None:
    text = listing()
    assert all(read(name).title in text for name in known())
    assert "stack: --set wire.command_angular_unit=milliradian" in text


def test_no_profile_changes_nothing() -> None:
    assert unkind() == KIND
    assert Profile(title="", source="").settings == {}
