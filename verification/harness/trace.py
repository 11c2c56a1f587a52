"""The trace of the simulated board, read while the simulator writes it."""

import contextlib
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Self

from common.freshness import NS_PER_S
from sim.trace import BumperSent, Command, read


class TraceFollower:
    """Collects motion commands and bumper hits from a growing trace."""

    def __init__(self, file: Path) -> None:
        self.commands: list[Command] = []
        self.hits: list[BumperSent] = []  # frames from the board that report a pressed bumper
        self._file, self._bytes = file, 0  # read so far

    def follow(self) -> Self:
        """Read what was written since the last call; an incomplete line waits."""
        with contextlib.suppress(FileNotFoundError), self._file.open("rb") as file:
            file.seek(self._bytes)
            new = file.read()
            whole = new[: new.rfind(b"\n") + 1]
            self._bytes += len(whole)
            for line in read(whole):
                if isinstance(line, Command):
                    self.commands.append(line)
                elif isinstance(line, BumperSent) and line.pressed:
                    self.hits.append(line)
        return self

    def forget(self) -> None:
        """Drop all hits, and all commands but the last."""
        del self.commands[:-1]
        self.hits.clear()


def moves(command: Command) -> bool:
    """Return whether a command moves the vehicle."""
    return command.kind == "run" and bool(command.linear or command.angular)


def first_stop_s(
    commands: Sequence[Command], since_ns: int, kinds: Collection[str] = ("stop", "brake")
) -> float | None:
    """Return the time until the first STOP or BRAKE, in seconds; None without one."""
    stops = [c.mono_ns for c in commands if c.kind in kinds and c.mono_ns >= since_ns]
    return (stops[0] - since_ns) / NS_PER_S if stops else None


def last_move_s(commands: Sequence[Command], since_ns: int) -> float:
    """Return the time until the last command that moves the vehicle, in seconds; 0 if none."""
    moving = [c.mono_ns for c in commands if moves(c) and c.mono_ns >= since_ns]
    return (moving[-1] - since_ns) / NS_PER_S if moving else 0.0
