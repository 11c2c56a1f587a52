"""What is seen of a soak: every life of every process, what was done, what was told."""

from dataclasses import dataclass, field

import msgspec


@dataclass(frozen=True, slots=True)
class Life:
    """One life of a process: who, and which of its incarnations."""

    name: str
    pid: int
    started: int  # clock ticks since boot


@dataclass(frozen=True, slots=True)
class Sample:
    """How a process fared at one moment."""

    at_s: float  # since the soak began
    rss: int  # bytes
    threads: int
    descriptors: int


@dataclass(frozen=True, slots=True)
class Progress:
    """Something that the driver has told."""

    at_s: float
    what: str  # "step", "lap finished", "begun anew"


@dataclass(frozen=True, slots=True)
class Window:
    """A time in which no command may move the vehicle."""

    name: str
    from_ns: int
    to_ns: int


@dataclass(slots=True)
class Record:
    """All that was seen."""

    lives: dict[Life, list[Sample]] = field(default_factory=dict)
    progress: list[Progress] = field(default_factory=list)
    log: list[tuple[float, int]] = field(default_factory=list)  # time, bytes so far
    tracebacks: int = 0
    crashes: list[str] = field(default_factory=list)
    windows: list[Window] = field(default_factory=list)
    moved: list[tuple[str, float]] = field(default_factory=list)  # fault, seconds too late
    health: dict[str, list[float]] = field(default_factory=dict)  # times by service
    faults: list[tuple[float, str]] = field(default_factory=list)
    late_s: float = 0.0  # how late the watcher itself was at worst
    seconds: float = 0.0  # that it lasted


def encoded(record: Record) -> bytes:
    """Return all of it as JSON; ``lives`` is a list of pairs there."""
    fields = {name: getattr(record, name) for name in record.__dataclass_fields__}
    return msgspec.json.encode(fields | {"lives": list(record.lives.items())})
