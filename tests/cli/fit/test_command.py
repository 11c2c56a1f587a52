"""``t2 fit`` on recordings of synthetic stops."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from cli.__main__ import main
from cli.fit.streams import Streams
from cli.settings import Everything
from common.cli_args import EXIT_CONFIG
from common.config import Sources, load
from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.bridge.config import BridgeConfig
from services.odom.config import Odom, OdomConfig
from services.recorder.mcap_codec import Encoder
from services.recorder.writer import RecordingWriter
from services.safety.config import SafetyConfig
from sim.config import load_model
from t2 import codec, keys
from t2.messages import Command, Message, Settings
from tests.cli.fit.closed_fixture import closed_streams
from tests.cli.fit.stops_fixture import streams
from tests.cli.recordings.settings_fixture import settings_of
from tests.recorder.samples import bare

pytestmark = pytest.mark.simulated

PATHS = {"motions": "@cmd/motion", "velocities": "tel/bridge/velocity",
         "mileages": "tel/bridge/mileage", "odometries": "tel/odom/odometry"}  # fmt: skip
CAREFUL = (
    *("--set", "safety.react=0.4", "--set", "vehicle.deceleration=0.5"),
    *("--set", "vehicle.angular_deceleration=0.5"),
)
SPEEDS = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9)
ALL = (*SPEEDS, *(-speed for speed in SPEEDS))


def record(
    path: Path, *robots: Streams, host: int = 0, settings: Mapping[str, Settings] | None = None
) -> Path:
    """Record the streams of robot 001, and of 002, and the settings of services of 001."""
    messages: list[tuple[str, Message]] = [
        (f"t2/v1/00{number}/{key}", replace(each, host=host))
        for number, streams in enumerate(robots, 1)
        for name, key in PATHS.items()
        for each in getattr(streams, name)
    ]
    messages += [
        (keys.SETTINGS.on("001", service=service), replace(each, mono_ns=messages[0][1].mono_ns))
        for service, each in (settings or {}).items()
    ]
    writer = RecordingWriter(path, Encoder(Vehicle()))
    for key, each in sorted(messages, key=lambda one: one[1].mono_ns):
        at_s = each.mono_ns / NS_PER_S
        one = bare("", codec.encode(each), codec.encoding(type(each)), at_s)
        writer.write(replace(one, key=key))
    writer.write(bare("tel/mine", b"\xc1", at_s=at_s))
    writer.close()
    return path


def driven(*speeds: float, first_s: float = 10.0, **how: Any) -> Streams:
    """Return stops and turns from each speed (m/s and rad/s), ten seconds apart."""
    made = Streams()
    for number, (speed, turns) in enumerate((s, t) for t in (False, True) for s in speeds):
        sign, begin_s = (1 if speed > 0 else -1), first_s + 10.0 * number
        one = streams(sign=sign, speed=abs(speed), begin_s=begin_s, turns=turns, **how)
        made.motions += one.motions
        made.velocities += one.velocities
        made.mileages += one.mileages
    return made


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("stops") / "a.mcap", driven(*ALL))


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_all_that_safety_needs_is_measured(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A stop in two recordings counts once: the black box records what `t2 record` also has."""
    assert main(["fit", str(path), str(path), "--stops", "--out", "fitted", *CAREFUL]) == 0
    printed, errors = capsys.readouterr()
    assert not errors
    assert "\x1b" not in printed
    lines = printed.splitlines()
    (reaction,) = (line for line in lines if line.startswith("STOP forward: reaction"))
    assert reaction.split()[-4:] == ["6", "safety.react", "0.4", "0.22"]
    assert sum("STOP backward  " in line for line in lines) == 6
    assert "No stop was longer than safety reckons with.\n" in printed
    assert "NOT MEASURED" not in printed
    assert printed.endswith("Written: fitted: fit.toml, profile.toml, fit.html\n")
    proposed = load(Everything, Sources((Path("fitted/fit.toml"),), {}, ())).config
    assert (proposed.safety.react, proposed.vehicle.deceleration) == (0.22, 0.49)
    model = load_model(["fitted/profile.toml"])
    assert model.drive.coast == pytest.approx(0.5, abs=0.003)
    assert model.drive.dead_time == pytest.approx(0.1, abs=0.003)


def test_a_stop_that_was_too_long_is_the_first_line(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = record(tmp_path / "b.mcap", driven(0.6, -0.6, first_s=400.0, deceleration=0.3))
    assert main(["fit", str(path), str(other), "--stops"]) == 1
    printed = capsys.readouterr().out
    assert printed.startswith("NOT SAFE: STOP ")
    rows = [line.split()[3:] for line in printed.splitlines() if "  m     0.600  " in line]
    assert len(rows) == 4
    for speed, _, _, distance, needed, reckoned in (map(float, row[1:]) for row in rows):
        # two periods of the sonars and one of the decisions, from a reading to the command
        assert needed == pytest.approx(distance + 0.12 * speed, abs=0.002)
        assert reckoned == pytest.approx(0.27 * speed + speed**2 / 1.2, abs=0.002)
        assert needed > reckoned
    assert {0.3, 0.5} == {round(float(row[3]), 1) for row in rows}


def test_each_direction_is_needed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    forward = record(tmp_path / "c.mcap", driven(*SPEEDS))
    braked = driven(*(-speed for speed in SPEEDS), first_s=500.0, command=Command.BRAKE)
    backward = record(tmp_path / "d.mcap", braked)
    assert main(["fit", str(forward), str(backward), *CAREFUL]) == 1
    printed = capsys.readouterr().out
    assert "BRAKE backward: deceleration" in printed
    assert "NOT MEASURED: 5 more of STOP backward from 0.40 m/s or more.\n" in printed
    assert "NOT MEASURED: 5 more of STOP right from 0.40 rad/s or more.\n" in printed
    assert "of STOP left" not in printed
    assert "NOT SAFE" not in printed
    (text,) = (file.read_text() for file in tmp_path.glob("out/*/fit.toml"))
    assert "react" not in text
    assert "# Not measured: 5 more of STOP backward" in text


def test_the_fitted_vehicle_explains_its_recording_and_no_other_one(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The synthetic vehicle stops without having driven off: only its stops are explained."""
    other = record(tmp_path / "other.mcap", driven(*ALL, deceleration=1.5))
    for number, (file, explained) in enumerate(((path, True), (other, False))):
        out = f"page{number}"
        assert main(["fit", str(path), "--check", str(file), "--out", out, *CAREFUL]) == 1
        printed = capsys.readouterr().out
        (stops,) = (line for line in printed.splitlines() if line.startswith("stops, m:"))
        assert ("NOT EXPLAINED" not in stops) is explained
        html = (tmp_path / out / "fit.html").read_text()
        assert html.count("<svg") == 7
        assert "The model under the recorded commands" in html
        assert stops in html


def test_a_distance_by_tape_measure_is_in_the_profile(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fit", str(path), "--drove", "0.001", "--out", "wild", *CAREFUL]) == 1
    assert "NOT MEASURED: true counters: distance, counted / driven is " in capsys.readouterr().out
    assert "scale" not in Path("wild/profile.toml").read_text()  # the simulator has none as wild
    with pytest.raises(SystemExit):
        main(["fit", str(path), "--drove", "-1"])
    assert "argument --drove: -1 must be more than 0" in capsys.readouterr().err


def test_noises_of_odometry_from_closed_drives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    noise = Odom(distance_noise=0.03, turn_noise=0.06, drift_noise=0.03)
    made = [
        closed_streams(seed, noise=noise, begin_s=100.0 * seed, period_s=0.02) for seed in (1, 2)
    ]
    files = [str(record(tmp_path / f"{n}.mcap", one, host=1)) for n, one in enumerate(made)]
    assert main(["fit", *files, "--closed", "--out", "fitted"]) == 1  # no stop was measured
    printed = capsys.readouterr().out
    assert "Closed drive 0.mcap: 20" in printed
    assert "3 more closed drives are missing until a noise may be smaller." in printed
    proposed = load(Everything, Sources((Path("fitted/fit.toml"),), {}, ())).config.odom
    assert proposed.distance_noise > 0.03
    assert proposed.turn_noise == pytest.approx(2 * proposed.distance_noise, abs=0.002)
    assert proposed.drift_noise == proposed.distance_noise
    assert main(["fit", *files, files[0], "--closed"]) == 1
    assert "0.mcap and 0.mcap are of the same time: name one" in capsys.readouterr().err
    assert main(["fit", *files]) == 1
    assert "losed drive" not in capsys.readouterr().out


def test_a_closed_drive_whose_end_is_not_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = record(tmp_path / "whole.mcap", closed_streams(1, period_s=0.02), host=1)
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:-4000])
    assert main(["fit", "cut.mcap", "--closed"]) == 1
    assert "--closed cut.mcap: cut.mcap: truncated or damaged" in capsys.readouterr().err


def test_robots_are_not_mixed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    merged = str(record(tmp_path / "two.mcap", driven(*ALL), driven(0.5, first_s=11.0)))
    assert main(["fit", merged]) == 1
    assert "recordings of 001, 002: choose one with --robot" in capsys.readouterr().err
    assert main(["fit", merged, "--robot", "001", *CAREFUL]) == 0


def test_the_clock_of_another_start_of_the_computer(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both begin at the same monotonic time; the stops of each are measured."""
    again = record(tmp_path / "again.mcap", driven(*ALL), host=7)
    assert main(["fit", str(path), str(again), "--stops", *CAREFUL]) == 0
    printed = capsys.readouterr().out
    assert printed.count("STOP forward  ") == 12
    assert printed.count("Greatest speeds: 0.90 m/s and 0.90 rad/s.") == 2


def test_a_recording_that_was_cut_is_used(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:-4000])
    assert main(["fit", "cut.mcap", *CAREFUL]) in (0, 1)
    assert "cut.mcap: truncated or damaged; what it holds is used." in capsys.readouterr().out


def test_what_it_cannot_evaluate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    still = driven(0.5)
    still.motions = []
    stands = record(tmp_path / "still.mcap", still)
    coarse = driven(0.5)
    coarse.velocities = coarse.velocities[::5]
    laptop = record(tmp_path / "laptop.mcap", coarse)
    (tmp_path / "taken").mkdir()
    whole = record(tmp_path / "whole.mcap", driven(0.5))
    for words, code, error in (
        ((stands,), 1, "still.mcap: has no @cmd/motion: record all keys with `t2 record`"),
        ((laptop,), 1, "has a velocity each 0.10 s, too coarse for a stop"),
        ((stands, "--robot", "002"), 1, "has no message of robot 002 to measure"),
        ((whole, "--out", "taken"), EXIT_CONFIG, "--out taken: exists already"),
    ):
        assert main(["fit", *map(str, words)]) == code
        assert error in capsys.readouterr().err


# --- settings -------------------------------------------------------------------------------------


def of_robot(**others: Any) -> dict[str, Settings]:
    """Return the settings of a careful robot, as its services publish them."""
    vehicle: dict[str, Any] = {"vehicle__deceleration": 0.5, "vehicle__angular_deceleration": 0.5}
    safety = {"safety__react": 0.4} | vehicle | others
    return {
        "bridge": settings_of(BridgeConfig(), **vehicle),
        "odom": settings_of(OdomConfig()),
        "safety": settings_of(SafetyConfig(), **safety),
    }


def today(printed: str, setting: str) -> str:
    """Return the value of a setting in the column "today"."""
    (row,) = (line.split() for line in printed.splitlines() if f" {setting} " in line)
    return row[row.index(setting) + 1]


def test_the_settings_of_the_recording_are_those_of_today(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(record(tmp_path / "a.mcap", driven(*ALL), settings=of_robot()))
    assert main(["fit", path, "--out", "a"]) == 0
    printed = capsys.readouterr().out
    assert (today(printed, "safety.react"), today(printed, "vehicle.deceleration")) == (
        "0.4",
        "0.5",
    )
    assert "\nSettings: those of bridge, odom, safety in the recording.\n" in printed
    assert "NOT SAFE" not in printed
    assert "Settings: those of bridge" in Path("a/fit.html").read_text()

    Path("other.toml").write_text("[safety]\nreact = 0.2\n")
    assert main(["fit", path, "--out", "b", "--config", "other.toml"]) == 1
    printed = capsys.readouterr().out
    assert printed.startswith("NOT SAFE: ")
    assert (today(printed, "safety.react"), today(printed, "vehicle.deceleration")) == (
        "0.2",
        "0.6",
    )
    assert "\nSettings: other.toml.\n" in printed

    assert main(["fit", path, "--out", "c", "--set", "safety.react=0.3"]) == 0
    printed = capsys.readouterr().out
    assert (today(printed, "safety.react"), today(printed, "vehicle.deceleration")) == (
        "0.3",
        "0.5",
    )
    assert (
        "Settings: those of bridge, odom, safety in the recording and --set safety.react=0.3.\n"
        in printed
    )


def test_recordings_without_settings(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["fit", str(path), "--out", "a"])
    assert (
        "Settings: the defaults: no settings in the recording; name those of the robot with "
        "--config.\n" in capsys.readouterr().out
    )


def test_recordings_with_several_settings(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The newest is used, in whatever order the files are named."""
    old = record(tmp_path / "old.mcap", driven(*ALL), settings=of_robot(safety__react=0.2))
    late = driven(0.5, first_s=900.0)
    new = record(tmp_path / "new.mcap", late, settings=of_robot(safety__foreign=1))
    for number, files in enumerate(((old, new), (new, path, old))):
        assert main(["fit", *map(str, files), "--out", str(number)]) == 0
        printed = capsys.readouterr().out
        assert today(printed, "safety.react") == "0.4"
        assert (
            "Settings: the newest, because the recordings disagree about safety.react.\n" in printed
        )
        assert "Settings: ignored, unknown to this version of T2: safety.foreign.\n" in printed


def test_a_recorded_value_out_of_range(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = of_robot(safety__react=9.0)
    path = str(record(tmp_path / "a.mcap", driven(0.5), settings=settings))
    assert main(["fit", path]) == EXIT_CONFIG
    assert (
        "a.mcap: tel/safety/settings: safety.react = 9.0: Expected `float` <= 2.0; allowed is "
        "0.0..2.0 s\n" in capsys.readouterr().err
    )


def test_settings_that_contradict_each_other(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fit", str(path), "--set", "vehicle.sonar_max=0.6"]) == EXIT_CONFIG
    assert "sonar_max 0.6 m is too near" in capsys.readouterr().err
