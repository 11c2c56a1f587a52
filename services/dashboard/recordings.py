"""The recorder's folder on the page: recordings to download, and their reports to read."""

import asyncio
import contextlib
import os
import re
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from stat import S_ISREG

from msgspec import Struct, json
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

PATH = "/recordings/"
# No separator and no leading dot: a file of the folder itself.
NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,120}\.(mcap|html)")
LIST_MAX = 50  # the newest
CHUNK = 65_536  # bytes
RATE = 2_000_000  # bytes per second: downloads leave room for a driver on the same link
# A report is one file without scripts; a recording may have put anything into its texts.
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox"


class Recording(Struct, frozen=True):
    """One recording, and the name of its report if `t2 report` has made one."""

    name: str
    size: int  # bytes
    changed: int  # s since 1970, UTC
    report: str


def routes(folder: Path) -> list[Route]:
    """Return the routes that list and serve this folder; requests change nothing."""
    pace = asyncio.Lock()

    async def index(_: Request) -> Response:
        found = await asyncio.to_thread(lambda: list(listed(folder)))
        return Response(json.encode(found), media_type="application/json")

    async def file(request: Request) -> Response:
        path = folder / request.path_params["name"]
        if status_of(path) is None:
            return PlainTextResponse("no such recording\n", status_code=404)
        if path.suffix == ".html":
            policy = {"content-security-policy": REPORT_POLICY}
            return StreamingResponse(throttled(path, pace), media_type="text/html", headers=policy)
        attachment = {"content-disposition": f'attachment; filename="{path.name}"'}
        return StreamingResponse(
            throttled(path, pace), media_type="application/octet-stream", headers=attachment
        )

    return [Route(PATH, index), Route(PATH + "{name}", file)]


def listed(folder: Path) -> Iterator[Recording]:
    """Yield the newest recordings, the newest first; none without the folder."""
    found = {path: stat for path in folder.glob("*.mcap") if (stat := status_of(path))}
    newest = sorted(found, key=lambda path: found[path].st_mtime, reverse=True)
    for path in newest[:LIST_MAX]:
        report = path.with_suffix(".html")
        yield Recording(
            name=path.name,
            size=found[path].st_size,
            changed=round(found[path].st_mtime),
            report=report.name if status_of(report) else "",
        )


def status_of(path: Path) -> os.stat_result | None:
    """Return the status of a file that may be served; None for any other, or if it is gone."""
    with contextlib.suppress(OSError):
        stat = path.lstat()
        if NAME.fullmatch(path.name) and S_ISREG(stat.st_mode):
            return stat
    return None


async def throttled(path: Path, pace: asyncio.Lock) -> AsyncIterator[bytes]:
    """Yield the content of a file; ``RATE`` holds for all that share ``pace`` together."""
    with path.open("rb") as file:
        while chunk := await asyncio.to_thread(file.read, CHUNK):
            yield chunk
            async with pace:
                await asyncio.sleep(CHUNK / RATE)
