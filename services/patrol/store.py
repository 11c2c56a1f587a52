"""The folder of patrol: routes, the ledger of rounds, their tracks, and the open round.

================= ============================================================================
routes/NAME.json  a route; people may edit it
rounds.jsonl      the ledger: a line for each round, appended and synchronized
rounds/ID.json    the route and the driven poses of a round, for its report
round.json        the round that is not over: a restarted service resumes it
teaching.json     the route that is being taught
================= ============================================================================

A file is replaced as a whole, so that a power loss leaves the old one or the new one. A line of the
ledger that was cut is skipped.
"""

import contextlib
import os
from collections.abc import Iterator
from itertools import chain, count, islice
from pathlib import Path

import msgspec
from msgspec import Struct
from msgspec.structs import asdict

from services.patrol.core.course import OpenRound
from services.patrol.core.routes import length, problem, stations
from services.patrol.core.teaching import OpenTeaching
from t2 import messages as m
from t2.messages import Phrase
from t2.text_file import read_text
from t2.words import render

LEDGER = 4 * 2**20  # bytes; then the older half is removed
TRACKS = 500  # the newest ones are kept
ROUTES, STATIONS = 500, 128  # that are listed, of a route
NAME = 200  # characters of a file that is no route
TAIL = 2**20  # bytes of the ledger that are listed
WAITING = 100  # lines at most that wait for a disk


class Tracked(Struct, frozen=True, kw_only=True):
    """The route and the driven poses of a round."""

    route: m.Route
    track: tuple[m.TrackPoint, ...] = ()


class Store:
    """Reads and writes the folder; methods raise ``OSError``."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.waiting: list[m.Round] = []  # rounds that are not written yet
        self._routes, self._rounds = folder / "routes", folder / "rounds"
        self._ledger, self._open = folder / "rounds.jsonl", folder / "round.json"
        self._teaching = folder / "teaching.json"
        self._known: dict[str, tuple[tuple[int, int], m.RouteSummary]] = {}  # by time and size

    # --- routes -----------------------------------------------------------------------------

    def routes(self) -> list[m.RouteSummary]:
        """Return all routes of the folder, those with a problem, too."""
        files = sorted(self._routes.glob("*.json"))
        names = (each.stem for each in files if each.suffix and _is_text(each.stem))
        listed = (name for name in names if self._route_file(name).is_file())
        return [self._summary(name) for name in islice(listed, ROUTES)]

    def has(self, name: str) -> bool:
        """Return whether there is a file of this route."""
        return self._route_file(name).exists()

    def route(self, name: str) -> m.Route | Phrase:
        """Return a route, or why it cannot be driven."""
        file = self._route_file(name)
        if not file.is_file():  # a pipe would be waited for
            return Phrase("route.none", {"route": name})
        try:
            route = msgspec.json.decode(read_text(file), type=m.Route)
        except (OSError, ValueError) as error:  # of msgspec, too
            reason = error.strerror if isinstance(error, OSError) else str(error)
            return Phrase("route.unreadable", {"file": file.name, "reason": reason or "?"})
        if route.name != name:
            return Phrase("route.name", {"file": file.name, "route": route.name})
        return problem(route) or route

    def save_route(self, route: m.Route) -> None:
        """Write a route."""
        _replace(self._route_file(route.name), route_text(route))

    def delete_route(self, name: str) -> None:
        """Remove a route."""
        self._route_file(name).unlink()
        _sync_folder(self._routes)

    def _summary(self, name: str) -> m.RouteSummary:
        """Return what a route is; its file is read only when it has changed."""
        about = self._route_file(name).stat()
        version = about.st_mtime_ns, about.st_size
        if name not in self._known or self._known[name][0] != version:
            self._known[name] = version, _summary(name, self.route(name))
        return self._known[name][1]

    def _route_file(self, name: str) -> Path:
        return self._routes / f"{name}.json"

    def write_teaching(self, of: OpenTeaching | None) -> None:
        """Note the route that is being taught; None: there is none any more."""
        if of is None:
            self._teaching.unlink(missing_ok=True)
        else:
            _replace(self._teaching, msgspec.json.encode(of), sync=False)

    def read_teaching(self) -> OpenTeaching | None:
        """Return the route that was being taught when the service ended."""
        with contextlib.suppress(FileNotFoundError, ValueError):
            return msgspec.json.decode(self._teaching.read_bytes(), type=OpenTeaching)
        return None

    # --- rounds -----------------------------------------------------------------------------

    def write_open(self, of: OpenRound, *, sync: bool) -> None:
        """Note the round that is driven; ``sync`` waits for the disk."""
        _replace(self._open, msgspec.json.encode(of), sync=sync)

    def read_open(self) -> tuple[OpenRound, m.Route] | None:
        """Return the round that was not over when the service ended; None without any."""
        try:
            found = msgspec.json.decode(self._open.read_bytes(), type=OpenRound)
        except FileNotFoundError:
            return None
        except ValueError as error:
            raise OSError(0, f"{self._open.name} cannot be read ({error})") from None
        if self.round(found.round.id) is not None:  # the power failed after its line was written
            return None
        tracked = self.tracked(found.round.id)
        if tracked is None:
            raise OSError(0, f"the route of the open round {found.round.id} cannot be read")
        return found, tracked.route

    def begin(self, of: OpenRound, route: m.Route) -> None:
        """Note a round that begins."""
        self._write_track(of.round, route, [])
        self.write_open(of, sync=True)

    def end(self, record: m.Round, route: m.Route, track: list[m.TrackPoint]) -> None:
        """Note a round that is over; what cannot be written waits for ``write_waiting``."""
        self.waiting = [*self.waiting, record][-WAITING:]
        self.write_waiting()
        self._write_track(record, route, track)
        files = sorted(self._rounds.glob("*.json"), key=lambda file: file.stat().st_mtime_ns)
        for old in files[:-TRACKS]:
            old.unlink()

    def new_id(self, stamp: str, route: str) -> str:
        """Return an id that no round has."""
        first = f"{stamp}-{route}"
        ids = chain([first], (f"{first}-{number}" for number in count(2)))
        return next(each for each in ids if not self._track_file(each).exists())

    def write_waiting(self) -> None:
        """Append the waiting rounds to the ledger."""
        while self.waiting:
            self._append(self.waiting[0])
            self._close(self.waiting.pop(0).id)
        self._bound()

    def _close(self, round_id: str) -> None:
        """Remove the note of the open round; a later round may have begun."""
        with contextlib.suppress(FileNotFoundError, ValueError):
            if msgspec.json.decode(self._open.read_bytes(), type=OpenRound).round.id == round_id:
                self._open.unlink()

    def rounds(self, most: int) -> list[m.Round]:
        """Return the newest rounds, the newest first; those that wait for the disk, too."""
        with contextlib.suppress(FileNotFoundError):
            return [*_decoded(self._tail()[-most:]), *self.waiting][::-1][:most]
        return self.waiting[::-1][:most]

    def _tail(self) -> list[bytes]:
        """Return the last lines of the ledger: the loop that drives must not wait for all."""
        with self._ledger.open("rb") as file:
            begin = max(0, file.seek(0, os.SEEK_END) - TAIL)
            file.seek(begin)
            return file.read().splitlines()[bool(begin) :]  # the first one is cut

    def round(self, round_id: str) -> m.Round | None:
        """Return a round of the ledger; None for an unknown id."""
        of_id = [each for each in self.waiting if each.id == round_id]
        with contextlib.suppress(FileNotFoundError):
            lines = self._ledger.read_bytes().splitlines()
            of_id += _decoded([line for line in lines if round_id.encode() in line])
        return next((each for each in of_id if each.id == round_id), None)

    def tracked(self, round_id: str) -> Tracked | None:
        """Return route and driven poses of a round; None without its file."""
        if "/" in round_id or "\0" in round_id:
            return None
        with contextlib.suppress(FileNotFoundError, ValueError):
            return msgspec.json.decode(self._track_file(round_id).read_bytes(), type=Tracked)
        return None

    def _track_file(self, round_id: str) -> Path:
        return self._rounds / f"{round_id}.json"

    def _write_track(self, record: m.Round, route: m.Route, track: list[m.TrackPoint]) -> None:
        tracked = Tracked(route=route, track=tuple(track))
        _replace(self._track_file(record.id), msgspec.json.encode(tracked))

    def _append(self, record: m.Round) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        with self._ledger.open("ab") as file:
            # A line that a power loss or a full disk has cut ends here.
            cut = b"\n" if file.tell() and not _ends_with_newline(self._ledger) else b""
            file.write(cut + msgspec.json.encode(record) + b"\n")
            file.flush()
            os.fsync(file.fileno())

    def _bound(self) -> None:
        with contextlib.suppress(FileNotFoundError):
            if self._ledger.stat().st_size > LEDGER:
                newer = self._ledger.read_bytes()[-LEDGER // 2 :]
                _replace(self._ledger, newer.partition(b"\n")[2])  # the first line is cut


def _summary(name: str, found: m.Route | Phrase) -> m.RouteSummary:
    if isinstance(found, Phrase):
        return m.RouteSummary(name=name[:NAME], problem=render([found]), phrases=(found,))
    return m.RouteSummary(name=name, length=length(found), stations=stations(found)[:STATIONS])


def _is_text(name: str) -> bool:
    """Return whether the name of a file is UTF-8, and so can be sent."""
    return not any("\ud800" <= sign <= "\udfff" for sign in name)


def route_text(route: m.Route) -> bytes:
    """Return the file of a route: a line for each field and each point."""
    fields = {key: value for key, value in asdict(route).items() if key != "points"}
    lines = [f" {quoted(key)}: {quoted(value)}," for key, value in fields.items()]
    points = ",\n".join(f"  {quoted(each)}" for each in route.points)
    return "\n".join(["{", *lines, ' "points": [', points, " ]", "}", ""]).encode()


def quoted(value: object) -> str:
    """Return a value as JSON, with spaces."""
    return msgspec.json.format(msgspec.json.encode(value), indent=0).decode()


def _decoded(lines: list[bytes]) -> Iterator[m.Round]:
    for line in lines:
        with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
            yield msgspec.json.decode(line, type=m.Round)


def _ends_with_newline(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"


def _replace(path: Path, content: bytes, *, sync: bool = True) -> None:
    """Replace a file as a whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f".{path.name}.new")
    with new.open("wb") as file:
        file.write(content)
        file.flush()
        if sync:
            os.fsync(file.fileno())
    new.replace(path)
    if sync:
        _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    file = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)
