"""Settings that services have published, taken from a recording.

A recorded setting may be of another version of T2: an unknown one is ignored, a missing one has its
default, and both are named. Protections are not checked: nothing drives with these settings.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, get_origin, get_type_hints

from msgspec import Struct

from cli.inspect.addressing import chunks
from cli.settings import Everything, safety_config
from common.config import DEFAULT, Setting, Sources, build, flatten, from_sets, load
from common.errors import ConfigError
from common.text import printable
from t2 import keys
from t2.messages import Settings, SettingValue

if TYPE_CHECKING:
    from services.recorder.mcap_codec import Entry

KIND = Settings.__name__
NONE_RECORDED = "no settings in the recording; name those of the robot with --config"
NAMED = 8  # settings in a remark


@dataclass(frozen=True, slots=True)
class Found:
    """A message with the settings of a service."""

    robot: str
    service: str
    origin: str  # for errors
    log_ns: int  # when the recorder received it
    message: Settings


@dataclass(frozen=True, slots=True)
class Chosen:
    """The settings that a command uses."""

    config: Everything
    origin: str  # for the reader
    remarks: Sequence[str] = ()  # what is not as it was recorded


def named(given: Sources, sections: Sequence[str]) -> Chosen:
    """Return the settings of files, environment and options; raise ``ConfigError``."""
    loaded = load(Everything, given)
    safety_config(loaded.config)
    origins = dict.fromkeys(one.origin for _, one in _of(sections, loaded.settings.items()))
    return Chosen(loaded.config, ", ".join(it for it in origins if it != DEFAULT) or "the defaults")


def found_in(entry: "Entry", file: Path) -> Found | None:
    """Return the settings in an entry of a recording; None for any other message."""
    if entry.kind != KIND:
        return None
    robot, path = chunks(entry.key)
    service = path.split("/")[1] if path.count("/") == 2 else ""
    message = entry.message
    if path != keys.SETTINGS.path.format(service=service) or not isinstance(message, Settings):
        return None
    return Found(robot, service, f"{file}: {path}", entry.log_ns, message)


def newest(found: Iterable[Found]) -> list[Found]:
    """Return the newest settings of each service, in the order of their recording."""
    by_service = {one.service: one for one in sorted(found, key=lambda one: one.log_ns)}
    return sorted(by_service.values(), key=lambda one: one.log_ns)


def restored(found: Sequence[Found], sections: Sequence[str], sets: Sequence[str] = ()) -> Chosen:
    """Return these sections of recorded settings, a later message before an earlier one.

    ``sets`` are options ``--set`` on top. Raise ``ConfigError`` that names message and setting.
    """
    recorded = {
        path: Setting(each.value, one.origin)
        for one in found
        for path, each in one.message.settings.items()
    }
    unknown = [path for path in recorded if not is_known(path)]
    given = {path: Setting(value, DEFAULT) for path, value in _of(sections, flatten(Everything()))}
    missing = [
        path
        for path in given
        if not any(other == path or other.startswith(f"{path}.") for other in recorded)
    ]
    given |= dict(_of(sections, ((at, one) for at, one in recorded.items() if at not in unknown)))
    options = [f"--set {each}" for each in sets]
    config = build(Everything, given | from_sets(Everything, sets))
    try:
        safety_config(config)
    except ConfigError as error:
        origins = dict.fromkeys((*(one.origin for one in found), *options))
        raise ConfigError(f"{', '.join(origins)}: {error}") from None
    remarks = []
    if unknown:
        remarks.append(f"ignored, unknown to this version of T2: {listed(unknown)}")
    if missing:
        remarks.append(f"not recorded, so the defaults of this version of T2: {listed(missing)}")
    services = ", ".join(sorted({one.service for one in found}))
    origin = " and ".join((f"those of {services} in the recording", *options))
    return Chosen(config, origin, remarks)


def is_known(path: str) -> bool:
    """Return whether this version of T2 has a setting with this path."""
    kind: Any = Everything
    for name in path.split("."):
        if isinstance(kind, type) and issubclass(kind, Struct):
            kind = get_type_hints(kind).get(name)
        else:
            kind = get_args(kind)[1] if get_origin(kind) is dict else None
    return kind is not None and not (isinstance(kind, type) and issubclass(kind, Struct))


def differing(found: Iterable[Found], sections: Sequence[str]) -> list[str]:
    """Return the settings in these sections that have several values in the messages."""
    first: dict[str, SettingValue] = {}
    return sorted(
        {
            path
            for one in found
            for path, setting in _of(sections, one.message.settings.items())
            if first.setdefault(path, setting.value) != setting.value
        }
    )


def listed(paths: Sequence[str]) -> str:
    """Return paths as text, of many the first ones."""
    more = f" and {len(paths) - NAMED} more" if len(paths) > NAMED else ""
    return printable(", ".join(paths[:NAMED])) + more


def _of(sections: Sequence[str], items: Iterable[tuple[str, Any]]) -> Iterable[tuple[str, Any]]:
    return ((path, it) for path, it in items if path.split(".")[0] in sections)
