"""The files of a fit: the proposed settings, and a profile for the simulator. Pure."""

from collections.abc import Iterable, Sequence
from math import isfinite
from statistics import mean

from cli.fit.fit import Fit, Value

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
    "counters.pull": ("turn counted on a straight line",),
    "sonar.noise": ("sonars at standstill, noise",),
    "sonar.saturation": ("sonars, greatest reading",),
}  # fmt: skip


def settings_file(found: Fit, sources: Sequence[str]) -> str:
    """Return the proposed settings as TOML, each with the observations that it follows from."""
    head = [f"# Measured by `t2 fit` in {', '.join(sources)}.", *_missing(found.missing)]
    return _toml(head, found.proposals)


def profile(found: Fit, sources: Sequence[str]) -> str:
    """Return a profile of the simulated vehicle that behaves as this one did."""
    by_name = {each.name: each for each in found.estimates}
    values: dict[str, Value] = {}
    for path, names in SAME.items():
        seen = [value for name in names if name in by_name for value in by_name[name].values]
        if seen and isfinite(mean(seen)):
            values[path] = round(mean(seen), 4)
    for path in ("drive.dead_time", "velocity.noise", "velocity.angular_noise"):
        if path in values:
            values[path] = max(0.0, float(values[path]))
    if found.ranges:
        values["sonar.quantum"] = round(min(each.resolution for each in found.ranges), 4)
    head = [
        f'title = "Measured in {len(sources)} recordings"',
        f"source = '{', '.join(sources)}'",
    ]
    return _toml(head, values)


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
