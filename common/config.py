"""Configuration loading: TOML files, environment and command line to frozen structs.

A setting is named by its path, ``board.port``. Sources in order of precedence, the last one wins:
files, tables that a program passes, environment (``T2__BOARD__PORT``, in any case), ``--set
board.port=4002``. Tables are merged across sources. Sections of other services are ignored; unknown
sections and fields are refused, because a misspelt setting would be lost silently. A certificate's
file name is relative to the settings file that contains it.
"""

import difflib
import os
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar, get_origin, get_type_hints

import msgspec
from msgspec import Struct

from common.errors import ConfigError

C = TypeVar("C", bound=Struct)

Table = tuple[str, Mapping[str, Any]]  # origin, and settings by path

DEFAULT_FILE = Path(__file__).parent.parent / "config" / "t2.toml"
ENV_PREFIX = "T2__"

# File names that are relative to the settings file: a folder with certificates can be moved.
FILE_SETTINGS = ("bus.ca", "bus.certificate", "bus.private_key", "bus.members")

# Replaced settings and their replacements.
REPLACED = {
    "wire.angular_unit": "wire.command_angular_unit and wire.feedback_angular_unit",
    "sim.sonar_noise": "sim.sonar.noise",
    "sim.sonar_cone": "sim.sonar.cone",
} | {
    f"{section}.i_accept": f"{section}.unsafe_overrides"
    for section in ("safety", "bridge", "board", "bus", "teleop", "metrics")
}

# Sections allowed in a file; a service reads its own and the shared ones.
SECTIONS = (
    "robot", "bus", "board", "wire", "log", "vehicle",
    "bridge", "safety", "odom", "teleop", "dashboard", "recorder", "metrics", "ros2", "sim",
)  # fmt: skip


class Sources(Struct, frozen=True):
    """Sources of settings, lowest precedence first."""

    files: Sequence[Path] = (DEFAULT_FILE,)
    environ: Mapping[str, str] = msgspec.field(default_factory=lambda: dict(os.environ))
    sets: Sequence[str] = ()
    tables: Sequence[Table] = ()  # on top of the files


class Setting(Struct, frozen=True):
    """One value and its origin."""

    value: Any
    origin: str


class Loaded(Struct, Generic[C], frozen=True):
    """A valid configuration and its settings by path."""

    config: C
    settings: dict[str, Setting]


def load(root: type[C], sources: Sources) -> Loaded[C]:
    """Read the sections of ``root``; raise ``ConfigError`` naming origin, field, value, allowed."""
    given: dict[str, Setting] = {}
    for file in sources.files:
        given |= _from_file(file)
    for origin, table in sources.tables:
        given |= {path: Setting(value, origin) for path, value in table.items()}
    given |= _from_environ(root, sources.environ)
    given |= _from_sets(root, sources.sets)
    names = {part.name for part in msgspec.structs.fields(root)}
    known = names | set(SECTIONS)
    for path, setting in given.items():
        section = path.split(".")[0]
        if section not in known:
            unknown = f"no section {section!r}{_suggestion(section, known)}"
            raise ConfigError(f"{setting.origin}: {path}: {unknown}")
    ours = {path: setting for path, setting in given.items() if path.split(".")[0] in names}
    tree = _nest(ours)
    try:
        config = msgspec.convert(tree, root)
    except msgspec.ValidationError as error:
        raise _explain(str(error), root, tree, ours) from None
    defaults = {path: Setting(value, "default") for path, value in flatten(config)}
    return Loaded(config, defaults | {path: given[path] for path in given if path in defaults})


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
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{shown}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # TOML, UTF-8, or a number of too many digits
        raise ConfigError(f"{shown}: is no TOML: {error}") from None


def _from_file(file: Path) -> dict[str, Setting]:
    origin = _shown_path(file)
    leaves = _leaves("", read_toml(file, origin), origin)
    return {at: _resolved(file, at, leaf) for at, leaf in leaves.items()}


def _resolved(file: Path, at: str, leaf: Setting) -> Setting:
    """Resolve a file name relative to the settings file; empty stays empty."""
    if at not in FILE_SETTINGS or not isinstance(leaf.value, str) or not leaf.value:
        return leaf
    return Setting(str(file.absolute().parent / leaf.value), leaf.origin)


def _shown_path(file: Path) -> str:
    """Return a file's name relative to the working directory if it is inside."""
    whole = file.absolute()
    return str(whole.relative_to(Path.cwd()) if whole.is_relative_to(Path.cwd()) else file)


def _leaves(path: str, value: Any, origin: str) -> dict[str, Setting]:
    """Return every setting in a value; an empty file has none."""
    try:
        return {at: Setting(leaf, origin) for at, leaf in flatten(value, path) if at or leaf}
    except RecursionError:
        raise ConfigError(f"{origin}: tables are nested too deep") from None


def _from_environ(root: type[Struct], environ: Mapping[str, str]) -> dict[str, Setting]:
    given: dict[str, Setting] = {}
    for name in sorted(name for name in environ if name.upper().startswith(ENV_PREFIX)):
        _check_text(f"environment {name}", name + environ[name])
        path = name[len(ENV_PREFIX) :].lower().replace("__", ".")
        given |= _leaves(path, _parse(root, path, environ[name]), f"environment {name}")
    return given


def _from_sets(root: type[Struct], sets: Sequence[str]) -> dict[str, Setting]:
    given: dict[str, Setting] = {}
    for text in sets:
        _check_text(f"--set {text}", text)
        path, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not path:
            raise ConfigError(f"--set {text}: should look like board.port=4002")
        given |= _leaves(path, _parse(root, path, value), f"--set {text}")
    return given


def _check_text(origin: str, text: str) -> None:
    """Refuse text from the system that is not UTF-8."""
    try:
        text.encode()
    except UnicodeEncodeError:
        shown = origin.encode(errors="backslashreplace").decode()
        raise ConfigError(f"{shown}: is no UTF-8") from None


def _parse(root: type[Struct], path: str, text: str) -> Any:
    """Parse a value by its field's type: text as is, tuples by commas, the rest as TOML."""
    wanted = _type_at(root, path)
    if wanted is str:
        return text
    if get_origin(wanted) is tuple and not text.startswith("["):
        return [_toml(part.strip()) for part in text.split(",")] if text else []
    return _toml(text)


def _toml(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):  # as in a file
        return text


def _type_at(root: type[Struct], path: str) -> Any:
    kind: Any = root
    for name in path.split("."):
        if not (isinstance(kind, type) and issubclass(kind, Struct)):
            return None
        kind = get_type_hints(kind).get(name)
    return kind


def _nest(settings: Mapping[str, Setting]) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    for path, setting in settings.items():
        *tables, leaf = path.split(".")
        branch = tree
        for name in tables:
            inner = branch.setdefault(name, {})
            if not isinstance(inner, dict):
                raise ConfigError(f"{setting.origin}: {path}: {name} is a value, not a table")
            branch = inner
        # An empty table sets nothing, so it replaces nothing.
        if setting.value != {} or not isinstance(branch.get(leaf), dict):
            branch[leaf] = setting.value
    return tree


def _suggestion(word: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(word, sorted(known), n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; there are {', '.join(sorted(known))}"


def _explain(
    error: str, root: type[Struct], tree: Any, given: Mapping[str, Setting]
) -> ConfigError:
    """Convert msgspec's error to origin, field, value and allowed range."""
    head, mark, tail = error.rpartition(" - at `$")  # the last one: a field may be called so
    what, at = (head, tail) if mark else (tail, "")
    path, kind = _locate(at.rstrip("`"), root, tree)
    unknown = re.search(r"unknown field `(.*)`", what)
    if unknown:
        known = [part.name for part in kind.fields]
        path = f"{path}.{unknown[1]}"
        if path in REPLACED:
            text = f"was replaced by {REPLACED[path]}"
            return ConfigError(f"{_origin(path, given)}: {path}: {text}")
        return ConfigError(
            f"{_origin(path, given)}: {path}: unknown{_suggestion(unknown[1], known)}"
        )
    shown = f" = {given[path].value!r}" if path in given else ""
    return ConfigError(f"{_origin(path, given)}: {path}{shown}: {what}{_allowed(kind)}")


def _locate(at: str, root: type[Struct], tree: Any) -> tuple[str, Any]:
    """Return the path of the invalid value, and its type.

    msgspec writes ``[...]`` for a key of a table of tables; it is the first invalid one.
    """
    path: list[str] = []
    kind: Any = msgspec.inspect.type_info(root)
    for name in re.findall(r"\w+|\[\.\.\.\]", at):
        if isinstance(kind, msgspec.inspect.DictType):
            kind = kind.value_type
            name = next(key for key, row in tree.items() if not _is_valid(row, kind.cls))
        elif isinstance(kind, msgspec.inspect.VarTupleType):
            kind = kind.item_type
            continue
        else:
            kind = next(part.type for part in kind.fields if part.name == name)
        path.append(name)
        tree = tree[name]
    return ".".join(path), kind


def _is_valid(row: Any, kind: type[Struct]) -> bool:
    try:
        msgspec.convert(row, kind)
    except msgspec.ValidationError:
        return False
    return True


def _origin(path: str, given: Mapping[str, Setting]) -> str:
    inside = [s.origin for p, s in given.items() if p == path or p.startswith(f"{path}.")]
    return ", ".join(dict.fromkeys(inside)) or "defaults"


def _allowed(kind: Any) -> str:
    """Describe the allowed values; msgspec's own error names one end of a range only."""
    words = getattr(kind, "values", ())
    if words:
        return f"; allowed is {', '.join(map(repr, words))}"
    low, high = getattr(kind, "ge", None), getattr(kind, "le", None)
    over = getattr(kind, "gt", None)
    if high is None or (low is None and over is None):
        return ""
    return f"; allowed is {low}..{high}" if over is None else f"; allowed is over {over}..{high}"
