"""``t2 why`` on recordings of the simulated stack."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from cli.__main__ import main
from common.cli_args import EXIT_CONFIG
from common.freshness import NS_PER_S
from sim import requests as q
from t2.codec import Sample
from tests.cli.recordings.decision_fixture import Tap, drive, reset, written
from tests.cli.recordings.settings_fixture import as_sample, boots, settings_of
from verification.search.bus import MS
from verification.search.stack import Stack

pytestmark = pytest.mark.simulated


@cache
def driven() -> tuple[Sample, ...]:
    """Drive, stop by a sonar, press the bumper, reset, drive, and end the source."""
    stack = Stack(step_ns=5 * MS)
    tap = Tap(stack)
    stack.run(1500)
    drive(stack)
    stack.run(500)
    drive(stack, 0.3)
    stack.run(1500)
    stack.vehicle.inject(q.Sonar(name="front", range=0.15))
    stack.run(1000)
    stack.vehicle.inject(q.Sonar(name="front"))
    stack.run(1000)
    stack.tap(200)
    stack.run(1000)
    reset(stack)
    drive(stack, 0.2)
    stack.run(1000)
    stack.sources["teleop"].message = None
    stack.run(1000)
    return tuple(tap.samples)


@pytest.fixture
def why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str]]:
    """Write samples to a file, run the command on it, and return exit code and output.

    ``names_file``: with the settings of the simulated robot as ``--config``.
    """
    settings = tmp_path / "robot.toml"
    settings.write_text(limits())

    def run(
        *words: str,
        samples: tuple[Sample, ...] | None = None,
        cut: int = 0,
        names_file: bool = True,
    ) -> tuple[int, str]:
        (tmp_path / "a.mcap").unlink(missing_ok=True)
        file = written(tmp_path / "a.mcap", driven() if samples is None else samples)
        if cut:
            file.write_bytes(file.read_bytes()[:-cut])
        config = ("--config", str(settings)) if names_file else ()
        code = main(["why", str(file), *config, *words])
        shown = capsys.readouterr()
        return code, shown.out + shown.err

    return run


def limits() -> str:
    """Return the limit sources of the simulated stack as TOML."""
    config = Stack(step_ns=5 * MS).processes["safety"].config
    rows = [
        f'{name} = {{lease = {source.lease}, silence = "{source.silence}"}}'
        for name, source in config.safety.limits.items()
    ]
    return "\n".join(["[safety.limits]", *rows])


def test_each_stop_with_its_cause_input_age_and_rule(why: Callable[..., tuple[int, str]]) -> None:
    code, shown = why()
    assert code == 0
    for line in (
        "replay: 474 of 474 motions agree, from 0.53 s  22:15:00 on; 27 others only give the state",
        "    3.57 s  22:15:03  STOP   blocked: No room toward the front: 0.15 m.\n"
        "            before: RUN 0.300 m/s, 0.000 rad/s\n"
        "            input: ultrasonic: front 0.15 m, 0.015 s old, limit 0.30 s\n"
        "            rule: STOP until the cause ends\n"
        "            zone: sonar front 0.15 m from the hull allows 0.000 m/s, 0.000 rad/s of the "
        "requested 0.300 m/s, 0.000 rad/s, measured 0.300 m/s, 0.000 rad/s; by safety.margin 0.2 m",
        "BRAKE  contact: The bumper was hit.",
        "            input: bumper: pressed, 0.000 s old, limit 0.07 s\n"
        "            rule: BRAKE latched until a reset, then a neutral request",
        "STOP   no_request: No command to drive.",
        "input: drive teleop: 0.200 m/s, 0.000 rad/s, 0.320 s old, limit 0.30 s, TOO OLD",
    ):
        assert line in shown


@pytest.mark.parametrize(
    ("at", "decided_at"),
    [
        ("4", "3.99 s  22:15:04"),
        ("22:15:04", "3.99 s  22:15:04"),
        ("0", "0.00 s"),
    ],
)
def test_one_decision(why: Callable[..., tuple[int, str]], at: str, decided_at: str) -> None:
    code, shown = why("--at", at)
    assert f"decision at {decided_at}" in shown
    if at == "0":
        assert (code, "not compared" in shown) == (0, True)
        return
    for line in (
        "bumper          0.015    0.070    free",
        "limit pendant   0.050    1.000    no cap",
        "blocked  stop       0.42     0  No room toward the front: 0.15 m.",
        "request: teleop: 0.300 m/s, 0.000 rad/s",
        "motion: STOP, verdict stop\nrecorded: STOP (agrees)",
    ):
        assert line in shown


@pytest.mark.parametrize(
    ("change", "lines"),
    [
        (
            "safety.margin=0.4",
            ["0 of 474 motions differ", "reaction of the vehicle is not simulated"],
        ),
        (
            "vehicle.max_linear=0.25",
            ["69 of 474", "first: RUN 0.260 m/s, 0.000 rad/s becomes RUN 0.250 m/s"],
        ),
        ("safety.sources.teleop.lease=0.1", ["first: RUN", "becomes STOP"]),
    ],
)
def test_other_settings(why: Callable[..., tuple[int, str]], change: str, lines: list[str]) -> None:
    code, shown = why("--set", change)
    assert code == 0
    assert f"with {change}: " in shown
    assert all(line in shown for line in lines), shown


@pytest.mark.parametrize("at", ["3.57", "22:15:03"])  # both are shown with the stop
def test_the_decision_of_a_stop(why: Callable[..., tuple[int, str]], at: str) -> None:
    _, shown = why("--at", at)
    assert "decision at 3.57 s  22:15:03" in shown
    assert "blocked  stop       0.00     0  No room toward the front: 0.15 m." in shown


def test_other_settings_at_one_decision(why: Callable[..., tuple[int, str]]) -> None:
    _, shown = why("--at", "3.4", "--set", "vehicle.max_linear=0.25")
    assert "motion: RUN 0.300 m/s" in shown
    assert "with vehicle.max_linear=0.25: RUN 0.2" in shown


def without(path: str) -> tuple[Sample, ...]:
    return tuple(one for one in driven() if not one.key.endswith(path))


def as_robot(robot: str) -> tuple[Sample, ...]:
    return tuple(replace(one, key=one.key.replace("/001/", f"/{robot}/")) for one in driven())


@pytest.mark.parametrize(
    ("samples", "words", "reason"),
    [
        (lambda: without("@cmd/motion"), (), "robot 001: has no @cmd/motion"),
        (lambda: without("tel/bridge/bumper"), (), "robot 001: has no tel/bridge/bumper"),
        (lambda: driven()[:5], (), "has no"),
        (lambda: (*driven(), *as_robot("002")), (), "001, 002: choose one with --robot"),
        (driven, ("--robot", "007"), "robot 007: has no @cmd/motion"),
        (driven, ("--at", "99"), "--at 99.0: the recording is from 0.00 s"),
        (driven, ("--at", "23:00:00"), "--at 23:00:00: the recording is from 0.00 s"),
    ],
)
def test_what_is_refused(
    why: Callable[..., tuple[int, str]],
    samples: Callable[[], tuple[Sample, ...]],
    words: tuple[str, ...],
    reason: str,
) -> None:
    code, shown = why(*words, samples=samples())
    assert (code, reason in shown) == (1, True), shown


def test_a_time_that_is_none(why: Callable[..., tuple[int, str]]) -> None:
    with pytest.raises(SystemExit):
        why("--at", "noon")


def test_one_of_two_robots_and_a_cut_file(why: Callable[..., tuple[int, str]]) -> None:
    both = tuple(sorted((*driven(), *as_robot("002")), key=lambda one: one.received_ns))
    code, shown = why("--robot", "002", samples=both, cut=20)
    assert code == 0
    assert "robot 002\nThe file is truncated or damaged: what is readable is used." in shown
    assert "474 of 474 motions agree" in shown


def test_settings_that_the_robot_did_not_have(
    why: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    other = tmp_path / "other.toml"
    other.write_text("[vehicle]\nmax_linear = 0.25\n")
    code, shown = why("--config", str(other))
    assert code == 1
    assert "first difference at 2." in shown
    assert "; these may not be the settings of the robot" in shown
    code, shown = why("--config", str(other), "--at", "2.6")
    assert code == 1
    assert "DIFFERS" in shown


def test_motions_that_end_while_the_vehicle_drives(why: Callable[..., tuple[int, str]]) -> None:
    """Safety died, or the recording ends: the bridge stops the vehicle, which no motion says."""
    begin_ns = driven()[0].received_ns
    samples = tuple(one for one in driven() if one.received_ns < begin_ns + 3 * NS_PER_S)
    _, shown = why(samples=samples)
    assert (
        "the motions of safety end here, or the recording\n            before: RUN 0.300" in shown
    )
    assert "the bridge stops the vehicle" in shown
    _, whole = why()
    assert "the motions of safety end here" not in whole


# --- settings -----------------------------------------------------------------------------------


def with_settings(boot: int | None = None, robot: str = "001", **others: Any) -> tuple[Sample, ...]:
    """Return the samples with the settings that safety had, in the middle; None removes one."""
    (running,) = boots(driven())
    config = Stack(step_ns=5 * MS).processes["safety"].config
    message = settings_of(config, running if boot is None else boot, **others)
    middle = len(driven()) // 2
    shown = as_sample(message, driven()[middle].wall_ns, robot=robot)
    return (*driven()[:middle], shown, *driven()[middle:])


def test_the_settings_of_the_recording_are_used(why: Callable[..., tuple[int, str]]) -> None:
    code, shown = why(samples=with_settings(), names_file=False)
    assert code == 0
    assert "\nsettings: those of safety in the recording\nreplay: 474 of 474 motions agree" in shown
    _, one = why("--at", "4", samples=with_settings(), names_file=False)
    assert "\nsettings: those of safety in the recording\ndecision at" in one
    assert "motion: STOP, verdict stop\nrecorded: STOP (agrees)" in one


def test_recorded_settings_decide(why: Callable[..., tuple[int, str]]) -> None:
    """Another speed limit than the robot had: its motions do not come out again."""
    slow = with_settings(vehicle__max_linear=0.25)
    code, shown = why(samples=slow, names_file=False)
    assert (code, "first difference at 2." in shown) == (1, True)
    assert "these may not be the settings" not in shown
    code, shown = why(samples=slow)
    assert code == 0
    assert "robot.toml\nreplay: 474 of 474 motions agree" in shown
    assert "in the recording" not in shown


def test_other_settings_than_the_recorded_ones(why: Callable[..., tuple[int, str]]) -> None:
    change = "vehicle.max_linear=0.25"
    code, shown = why("--set", change, samples=with_settings(), names_file=False)
    assert code == 0
    assert "settings: those of safety in the recording\nreplay: 474 of 474" in shown
    assert f"with {change}: 69 of 474 motions differ" in shown


def test_a_recording_without_settings(why: Callable[..., tuple[int, str]]) -> None:
    for samples in (driven(), with_settings(robot="002")):
        _, shown = why(samples=samples, names_file=False)
        assert (
            "settings: the defaults: no settings in the recording; name those of the robot with "
            "--config\n" in shown
        )


def test_a_run_of_safety_without_settings_has_those_of_another_one(
    why: Callable[..., tuple[int, str]],
) -> None:
    code, shown = why(samples=with_settings(boot=7), names_file=False)
    assert code == 0
    assert (
        "settings: those of safety in the recording, of another run: this one has none\n"
        "replay: 474 of 474" in shown
    )


def test_recorded_settings_of_another_version(why: Callable[..., tuple[int, str]]) -> None:
    samples = with_settings(safety__foreign=1, safety__react=None)
    code, shown = why(samples=samples, names_file=False)
    assert code == 0
    assert "settings: ignored, unknown to this version of T2: safety.foreign\n" in shown
    assert "settings: not recorded, so the defaults of this version of T2: safety.react\n" in shown


def test_a_recorded_value_out_of_range(why: Callable[..., tuple[int, str]]) -> None:
    samples = with_settings(vehicle__max_linear=99.0)
    code, shown = why(samples=samples, names_file=False)
    assert code == EXIT_CONFIG
    assert "a.mcap: tel/safety/settings: vehicle.max_linear = 99.0: Expected" in shown
    assert "allowed is 0.05..3.0 m/s" in shown
    assert why(samples=samples)[0] == 0
