"""The files of a fit: the proposed settings, and a profile for the simulator. Pure."""

import json
from collections.abc import Iterable, Sequence
from statistics import mean

from msgspec.structs import replace

from cli.fit.fit import Fit, Value
from cli.fit.steady import DELAY_STEP_S, GROUND
from common.config import Setting, build
from common.errors import ConfigError
from sim.model import Model

# Parameters of ``sim.model`` by the estimates whose mean they are.
SAME = {
    "drive.coast": ("STOP forward: deceleration", "STOP backward: deceleration"),
    "drive.angular_coast": ("STOP left: deceleration", "STOP right: deceleration"),
    "drive.brake": ("BRAKE forward: deceleration", "BRAKE backward: deceleration"),
    "drive.angular_brake": ("BRAKE left: deceleration", "BRAKE right: deceleration"),
    "drive.dead_time": (
        "STOP forward: reaction", "STOP backward: reaction", "STOP left: reaction",
        "STOP right: reaction",
    ),
    "velocity.bias": ("speed at standstill, bias",),
    "velocity.noise": ("speed at standstill, noise",),
    "velocity.angular_bias": ("turning speed at standstill, bias",),
    "velocity.angular_noise": ("turning speed at standstill, noise",),
    "sonar.noise": ("sonars at standstill, noise",),
    "sonar.saturation": ("sonars, greatest reading",),
}  # fmt: skip
TRUE = {
    "counters.scale": GROUND[0],
    "counters.turn_scale": GROUND[1],
}
DELAYS = ("RUN driving: delay", "RUN turning: delay")


def settings_file(found: Fit, sources: Sequence[str]) -> str:
    """Return the proposed settings as TOML, each with the observations that it follows from."""
    head = [f"# Measured by `t2 fit` in {', '.join(sources)}.", *_missing(found.missing)]
    return _toml(head, found.proposals)


def parameters(found: Fit) -> dict[str, Value]:
    """Return the parameters of ``sim.model`` that this vehicle has shown, by path."""
    by_name = {each.name: each for each in found.estimates}

    def observed(names: Sequence[str]) -> list[float]:
        return [value for name in names if name in by_name for value in by_name[name].values]

    values = {path: mean(seen) for path, names in SAME.items() if (seen := observed(names))}
    values |= {path: mean(seen) - 1 for path, name in TRUE.items() if (seen := observed([name]))}
    values["drive.dead_time"] = max(0.0, values.get("drive.dead_time", 0.0))
    if delays := observed(DELAYS):  # a ramp is followed later by dead time and lag
        lag = mean(delays) - values["drive.dead_time"]
        values["drive.lag"] = max(0.0, lag - DELAY_STEP_S)
    if found.ranges:
        values["sonar.quantum"] = min(each.resolution for each in found.ranges)
    rounded = {path: round(value, 4) + 0.0 for path, value in values.items()}  # no -0.0
    return {path: value for path, value in rounded.items() if _is_allowed(path, value)}


def _is_allowed(path: str, value: Value) -> bool:
    """Return whether the simulator has this value."""
    try:
        build(Model, {path: Setting(value, "t2 fit")})
    except ConfigError:
        return False
    return True


def model(found: Fit) -> Model:
    """Return the simulated vehicle that behaves as this one did."""
    given = {path: Setting(value, "t2 fit") for path, value in parameters(found).items()}
    return replace(build(Model, given), vehicle=found.settings.vehicle)


def profile(found: Fit, sources: Sequence[str]) -> str:
    """Return that vehicle as a profile of the simulator."""
    head = [
        f'title = "Measured in {len(sources)} recordings"',
        f"source = {json.dumps(', '.join(sources))}",
    ]
    return _toml(head, parameters(found))


def _missing(manoeuvres: Iterable[str]) -> list[str]:
    return [f"# Not measured: {each}." for each in manoeuvres]


def _toml(head: Sequence[str], values: dict[str, Value]) -> str:
    """Return settings by path as TOML."""
    lines = list(head)
    for section in dict.fromkeys(path.partition(".")[0] for path in values):
        lines += ["", f"[{section}]"]
        for path, value in values.items():
            table, _, name = path.partition(".")
            if table == section:
                lines.append(
                    f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {value}"
                )
    return "\n".join(lines) + "\n"
