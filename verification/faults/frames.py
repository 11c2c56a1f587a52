"""What the simulated board received, read while it is still being written."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Self

from common.freshness import NS_PER_S
from sim.trace import BumperSent, Command, read

SPEED = 0.8  # m/s, of every fault


class Frames:
    """Follows a trace to its end; one that begins anew is followed from its beginning."""

    def __init__(self, file: Path) -> None:
        self.commands: list[Command] = []
        self.hits: list[BumperSent] = []  # frames to us that tell of a pressed bumper
        self._file = file
        self._offset = 0

    def follow(self) -> Self:
        """Take in what was written since the last look."""
        try:
            with self._file.open("rb") as file:
                file.seek(self._offset)
                part = file.read()
        except FileNotFoundError:
            self._offset = 0
            return self
        whole = part[: part.rfind(b"\n") + 1]
        self._offset += len(whole)
        for line in read(whole):
            if isinstance(line, Command):
                self.commands.append(line)
            elif isinstance(line, BumperSent) and line.pressed:
                self.hits.append(line)
        return self

    def forget(self) -> None:
        """Keep the last command alone: the others were judged."""
        del self.commands[:-1]
        self.hits.clear()


def moves(command: Command) -> bool:
    """Tell whether a command lets the wheels turn."""
    return command.kind == "run" and bool(command.linear or command.angular)


def strayed(commands: Sequence[Command]) -> bool:
    """Tell whether any command was to move otherwise than the drivers asked: ahead, so fast."""
    return any(
        moves(c) and not (0.0 <= c.linear <= SPEED + 0.01 and c.angular == 0.0) for c in commands
    )


def first_stop_s(
    commands: Sequence[Command], fault_ns: int, kinds: Collection[str] = ("stop", "brake")
) -> float | None:
    """Return how long after the fault the first STOP or BREAK came; None if none came."""
    stops = [c.mono_ns for c in commands if c.kind in kinds and c.mono_ns >= fault_ns]
    return (stops[0] - fault_ns) / NS_PER_S if stops else None


def last_move_s(commands: Sequence[Command], fault_ns: int) -> float:
    """Return how long after the fault the last command to move came; 0 if none came."""
    moving = [c.mono_ns for c in commands if moves(c) and c.mono_ns >= fault_ns]
    return (moving[-1] - fault_ns) / NS_PER_S if moving else 0.0
