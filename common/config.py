"""Configuration loading: TOML files, environment and command line to frozen structs.

A setting is named by its path, ``board.port``. Sources in order of precedence, the last one wins:
files, environment (``T2__BOARD__PORT``, in any case), ``--set board.port=4002``. Tables are merged
across sources. Sections of other services are ignored; unknown sections and fields are refused,
because a misspelt setting would be lost silently. A value that takes a protection away is refused
unless ``unsafe_overrides``, at the top of a file, names its path. A certificate's file name is
relative to the settings file that contains it. ``~`` in a path is the home folder, in every source.
"""

import difflib
import os
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Any, Generic, TypeVar, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

from common.errors import ConfigError
from common.settings import Section, Shared, extra_of
from t2.text_file import expanded, read_text, typographic

C = TypeVar("C", bound=Struct)
R = TypeVar("R", bound=Shared)

DEFAULT_FILE = Path(__file__).parent.parent / "config" / "t2.toml"
ENV_PREFIX = "T2__"
DEFAULT = "default"  # the origin of a setting that no source names

# File names that are relative to the settings file: a folder with certificates can be moved.
FILE_SETTINGS = ("bus.ca", "bus.certificate", "bus.private_key", "bus.members")

PATHS = (
    *FILE_SETTINGS, "dashboard.token_file", "dashboard.certificate", "dashboard.private_key",
    "dashboard.floor_plan", "recorder.folder", "camera.credentials_file", "patrol.folder",
    "sim.world",
)  # fmt: skip
ENDPOINTS = ("bus.listen", "bus.connect", "bus.uplink", "bus.drive")
SOCKET = "unixsock-stream/"  # before the path in an endpoint
# Addresses with a password, before the host or in what follows: origins are printed and published.
SECRET = re.compile(
    r"://(?=\S*@|\S*(?:pas|pwd|secret|token|auth)\w*=)\S*|(?<==)[^/\s:]+:\S*@\S*", re.IGNORECASE
)
QUOTES = tuple("\"'\u2018\u2019\u201c\u201d\u201e\u00ab")

# Sections allowed in a file; a service reads its own and the shared ones.
SECTIONS = (
    "robot", "host", "bus", "board", "wire", "log", "vehicle", "safety", "odom", "localization",
    "patrol", "camera", "teleop", "dashboard", "recorder", "metrics", "ros2", "sim",
)  # fmt: skip


class Sources(Struct, frozen=True):
    """Sources of settings, lowest precedence first."""

    files: Sequence[Path] = (DEFAULT_FILE,)
    environ: Mapping[str, str] = msgspec.field(default_factory=lambda: dict(os.environ))
    sets: Sequence[str] = ()


class Setting(Struct, frozen=True):
    """One value and its origin."""

    value: Any
    origin: str


Given = dict[str, Setting]  # by path


class Loaded(Struct, Generic[C], frozen=True):
    """A valid configuration and its settings by path."""

    config: C
    settings: Given


def load(root: type[R], sources: Sources) -> Loaded[R]:
    """Read the sections of ``root``; raise ``ConfigError`` naming origin, field, value, allowed."""
    given = {path: Setting(value, DEFAULT) for path, value in flatten(root())}
    for file in sources.files:
        given |= _from_file(file)
    given |= _from_environ(root, sources.environ)
    given |= from_sets(root, sources.sets)
    names = {part.name for part in msgspec.structs.fields(root)}
    known = names | set(SECTIONS)
    for path, setting in given.items():
        section = path.split(".")[0]
        if section not in known:
            unknown = f"no section {section!r}{_suggestion(section, known)}"
            raise ConfigError(f"{setting.origin}: {path}: {unknown}")
    ours = {path: setting for path, setting in given.items() if path.split(".")[0] in names}
    config = build(root, ours)
    _check_protections(config, ours)
    default = {path: Setting(value, DEFAULT) for path, value in flatten(config)}
    return Loaded(config, default | {path: ours[path] for path in ours if path in default})


def build(root: type[C], given: Given) -> C:
    """Return a struct from its settings by path; raise ``ConfigError`` as ``load`` does."""
    return _struct(root, _nest(given), "", given)


def _check_protections(config: Shared, given: Given) -> None:
    """Refuse unsafe values without an override, and an override that has no effect.

    The overrides of sections that this service does not read are left to the services that do.
    """
    overrides, values = config.unsafe_overrides, dict(flatten(config))
    sections = {
        name: part
        for name in config.__struct_fields__
        if isinstance(part := getattr(config, name), Section)
    }
    safe = {
        f"{name}.{path}": allowed
        for name, part in sections.items()
        for path, allowed in part.protections().items()
    }
    where = f"{_origin('unsafe_overrides', given)}: unsafe_overrides names"
    for path in overrides:
        section = path.split(".")[0]
        if path not in safe and (section in sections or section not in SECTIONS):
            unknown = f"{path!r}, which takes no protection away{_suggestion(path, safe)}"
            raise ConfigError(f"{where} {unknown}")
    for path, allowed in safe.items():
        value = values[path]
        is_safe = allowed.low <= value <= allowed.high
        if is_safe and path in overrides:
            raise ConfigError(f"{where} {path!r}, but {value} is safe ({allowed}): remove it there")
        if not is_safe and path not in overrides:
            raise ConfigError(
                f"{_origin(path, given)}: {path} = {value} takes a protection away; allowed is "
                f"{allowed}, or name {path!r} in unsafe_overrides"
            )


def flatten(value: Any, path: str = "") -> Iterable[tuple[str, Any]]:
    """Yield every leaf of nested tables with its path; an empty table is a leaf."""
    table = msgspec.structs.asdict(value) if isinstance(value, Struct) else value
    if not isinstance(table, dict) or not table:
        yield path, value
        return
    for key, part in table.items():
        yield from flatten(part, f"{path}.{key}" if path else str(key))


def read_toml(file: Path, shown: str) -> dict[str, Any]:
    """Read a file; raise ``ConfigError`` that calls it ``shown``."""
    try:
        text = read_text(file)
    except OSError as error:
        raise ConfigError(f"{shown}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ConfigError(f"{shown}: {error}") from None
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # TOML, or a number of too many digits
        hint = f"; {found}" if (found := typographic(text)) else ""
        raise ConfigError(f"{shown}: is no TOML: {error}{hint}") from None


# --- sources ------------------------------------------------------------------------------------


def _from_file(file: Path) -> Given:
    whole = file.absolute()
    origin = str(whole.relative_to(Path.cwd()) if whole.is_relative_to(Path.cwd()) else file)
    given = _leaves("", read_toml(file, origin), origin)
    for path in given.keys() & FILE_SETTINGS:
        name = given[path].value
        if name and isinstance(name, str):
            given[path] = Setting(str(whole.parent / name), origin)
    return given


def _from_environ(root: type[Struct], environ: Mapping[str, str]) -> Given:
    given: Given = {}
    for name in sorted(name for name in environ if name.upper().startswith(ENV_PREFIX)):
        path = name[len(ENV_PREFIX) :].lower().replace("__", ".")
        given |= _from_text(root, path, environ[name], f"environment {name}")
    return given


def masked(text: str) -> str:
    """Return a text without the addresses in it that have a password."""
    return SECRET.sub("...", text)


def from_sets(root: type[Struct], sets: Sequence[str]) -> Given:
    """Return the settings of options ``--set PATH=VALUE``; raise ``ConfigError``."""
    given: Given = {}
    for text in sets:
        path, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not path:
            raise ConfigError(f"--set {text}: should look like board.port=4002")
        given |= _from_text(root, path, value, f"--set {masked(text)}")
    return given


def _from_text(root: type[Struct], path: str, text: str, origin: str) -> Given:
    """Parse a value by its field's type: text as is, tuples by commas, the rest as TOML."""
    try:
        (origin + text).encode()
    except UnicodeEncodeError:
        shown = origin.encode(errors="backslashreplace").decode()
        raise ConfigError(f"{shown}: is no UTF-8") from None
    wanted: Any = root
    for name in path.split("."):
        wanted = get_type_hints(wanted).get(name) if _is_struct(wanted) else None
    value: Any = text
    if get_origin(wanted) is tuple and not text.startswith("["):
        value = [_toml(part.strip()) for part in text.split(",")] if text else []
    elif wanted is not str:
        value = _toml(text)
    elif text.startswith(QUOTES):
        value = _unquoted(text, origin)
    return _leaves(path, value, origin)


def _toml(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):  # as in a file
        return text


def _unquoted(text: str, origin: str) -> str:
    """Return the text of a quoted value, which the shell has passed with its quotes."""
    value = _toml(text)
    if not isinstance(value, str) or value == text:
        raise ConfigError(f"{origin}: the quotes do not enclose the value: write it without quotes")
    return value


def _leaves(path: str, value: Any, origin: str) -> Given:
    """Return every setting in a value; an empty table sets nothing."""
    try:
        leaves = [(at, leaf) for at, leaf in flatten(value, path) if leaf != {}]
    except RecursionError:
        raise ConfigError(f"{origin}: tables are nested too deep") from None
    return {at: Setting(_with_home(at, leaf, origin), origin) for at, leaf in leaves}


def _with_home(path: str, value: Any, origin: str) -> Any:
    """Return a setting's value with ``~`` replaced in paths, and in paths of endpoints."""
    if isinstance(value, list) and path in ENDPOINTS:
        return [_with_home(path, each, origin) for each in value]
    if not isinstance(value, str):
        return value
    try:
        if path in ENDPOINTS and value.startswith(f"{SOCKET}~"):
            return SOCKET + expanded(value.removeprefix(SOCKET))
        return expanded(value) if path in PATHS else value
    except ValueError as error:
        raise ConfigError(f"{origin}: {path}: {error}") from None


def _nest(settings: Given) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    for path, setting in settings.items():
        *tables, leaf = path.split(".")
        branch = tree
        for name in tables:
            inner = branch.setdefault(name, {})
            if not isinstance(inner, dict):
                raise ConfigError(f"{setting.origin}: {path}: {name} is a value, not a table")
            branch = inner
        branch[leaf] = copy(setting.value)  # an empty default may get rows
    return tree


# --- types --------------------------------------------------------------------------------------


def _value(kind: Any, value: Any, path: str, given: Given) -> Any:
    """Return a value of an annotated type; raise ``ConfigError`` if it is none."""
    bare = get_args(kind)[0] if hasattr(kind, "__metadata__") else kind
    if _is_struct(bare) and isinstance(value, dict):
        return _struct(bare, value, path, given)
    if get_origin(bare) is dict and isinstance(value, dict):
        row = get_args(bare)[1]
        value = {name: _value(row, part, f"{path}.{name}", given) for name, part in value.items()}
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        what = str(error).partition(" - at `$")[0]  # the element of a tuple
        shown = f" = {given[path].value!r}" if path in given else ""
        of = get_args(bare)[0] if what != str(error) and get_origin(bare) is tuple else kind
        raise ConfigError(f"{_origin(path, given)}: {path}{shown}: {what}{_allowed(of)}") from None


def _struct(kind: type[C], table: Mapping[str, Any], path: str, given: Given) -> C:
    """Return a struct of a table's values; raise ``ConfigError`` for unknown and missing fields."""
    hints = get_type_hints(kind, include_extras=True)
    types = {name: hints[name] for name in kind.__struct_fields__}
    values = {}
    for name, value in table.items():
        at = f"{path}.{name}" if path else name
        if name not in types:
            elsewhere = [other for other in given if other.endswith(f".{name}") and other != at]
            unknown = f"unknown{_suggestion(*((at, elsewhere) if elsewhere else (name, types)))}"
            raise ConfigError(f"{_origin(at, given)}: {at}: {unknown}")
        values[name] = _value(types[name], value, at, given)
    for field in msgspec.structs.fields(kind):
        if field.required and field.name not in values:
            raise ConfigError(f"{_origin(path, given)}: {path}: needs {field.name!r}")
    try:
        return kind(**values)
    except ValueError as error:
        shown = f"{path}: " if path else ""
        raise ConfigError(f"{_origin(path, given)}: {shown}{error}") from None


def _is_struct(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Struct)


def _suggestion(word: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(word, sorted(known), n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; there are {', '.join(sorted(known))}"


def _origin(path: str, given: Given) -> str:
    """Return the origins of a setting, or of all settings of a table."""
    inside = [s for at, s in given.items() if f"{at}.".startswith(f"{path}." if path else "")]
    named = [s for s in inside if s.origin != DEFAULT] or inside
    return ", ".join(dict.fromkeys(setting.origin for setting in named))


def _allowed(kind: Any) -> str:
    """Describe the allowed values; msgspec's own error names one end of a range only."""
    info: Any = type_info(kind)
    words = getattr(info, "values", ())
    if words:
        return f"; allowed is {', '.join(map(repr, words))}"
    low, high = getattr(info, "ge", None), getattr(info, "le", None)
    over = getattr(info, "gt", None)
    unit = f" {extra_of(kind).get('unit', '')}".rstrip()
    if high is None or (low is None and over is None):
        return f"; the unit is{unit}" if unit else ""
    return f"; allowed is {low if over is None else f'over {over}'}..{high}{unit}"


def type_info(kind: Any) -> Any:
    """Return msgspec's description of a type, without our unit."""
    info = msgspec.inspect.type_info(kind)
    return info.type if isinstance(info, msgspec.inspect.Metadata) else info
