"""Record of a soak: samples of every process, faults, progress."""

from dataclasses import dataclass, field

import msgspec


@dataclass(frozen=True, slots=True)
class Life:
    """One run of a process between start and end."""

    name: str
    pid: int
    started: int  # clock ticks since boot


@dataclass(frozen=True, slots=True)
class Sample:
    """Resources of a process at one time."""

    at_s: float  # since the soak began
    rss: int  # bytes
    threads: int
    descriptors: int


@dataclass(frozen=True, slots=True)
class Progress:
    """An event of the driver."""

    at_s: float
    what: str  # "step", "lap finished", "begun anew"


@dataclass(frozen=True, slots=True)
class Window:
    """A period in which no command may move the vehicle."""

    name: str
    from_ns: int
    to_ns: int


@dataclass(slots=True)
class Record:
    """All observations."""

    lives: dict[Life, list[Sample]] = field(default_factory=dict)
    progress: list[Progress] = field(default_factory=list)
    log: list[tuple[float, int]] = field(default_factory=list)  # time, bytes so far
    tracebacks: int = 0
    crashes: list[str] = field(default_factory=list)
    windows: list[Window] = field(default_factory=list)
    moved: list[tuple[str, float]] = field(default_factory=list)  # fault, seconds too late
    health: dict[str, list[float]] = field(default_factory=dict)  # times by service
    faults: list[tuple[float, str]] = field(default_factory=list)
    late_s: float = 0.0  # largest lateness of the soak's own loop
    seconds: float = 0.0  # duration


def encoded(record: Record) -> bytes:
    """Encode as JSON, with ``lives`` as a list of pairs."""
    fields = {name: getattr(record, name) for name in record.__dataclass_fields__}
    return msgspec.json.encode(fields | {"lives": list(record.lives.items())})
