"""Path and permissions of the drive link's Unix socket.

The socket is in a directory of the user of bridge and safety that no other user can enter. The file
permissions decide which programs may command motion.
"""

import os
import stat
from pathlib import Path
from zlib import crc32

from common.errors import ConfigError
from common.settings import BusSettings, drive_path

NETWORK = Path("/proc/self/ns/net")


def socket_path(where: BusSettings, robot: str) -> Path:
    """Return the socket path that bridge and safety of one stack share.

    Without ``bus.drive`` it is derived from user, robot, router and network namespace. It does not
    depend on the login session, so that both find it from any shell.
    """
    if where.drive:
        return Path(drive_path(where.drive))
    router = crc32(" ".join((_network(), *where.endpoints)).encode())
    folder = Path(os.environ.get("TMPDIR") or "/tmp") / f"t2-{os.getuid()}"
    path = folder / f"{robot}-{router:08x}.sock"
    try:
        drive_path(f"unixsock-stream/{path}")
    except ValueError as error:
        raise ConfigError(f"bus.drive: {error}; name a shorter one") from None
    return path


def check_router(where: BusSettings) -> None:
    """Refuse several routers: sessions of one robot could settle on different ones.

    An emergency stop that reaches one of them would then pass safety or the bridge by.
    """
    if (count := len(set(where.connect))) > 1:
        raise ConfigError(
            f"bus.connect: bridge and safety need one router, not {count}: name the robot's own, "
            "and connect it to others by bus.uplink"
        )


def prepare(path: Path) -> None:
    """Create the socket's directory; raise ``ConfigError`` if other users could connect."""
    folder = path.parent
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise ConfigError(f"bus.drive: {folder}: {error.strerror}") from None
    private = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o077
    if not private or found.st_uid != os.getuid():
        raise ConfigError(
            f"bus.drive: {folder} must be a directory of this user that no other user can enter "
            f"(chmod 700); it has mode {stat.S_IMODE(found.st_mode):o} and owner {found.st_uid}"
        )
    try:
        is_socket = stat.S_ISSOCK(path.lstat().st_mode)
    except FileNotFoundError:
        return
    except OSError as error:
        raise ConfigError(f"bus.drive: {path}: {error.strerror}") from None
    if not is_socket:  # Zenoh would remove it; a stale socket may stay
        raise ConfigError(f"bus.drive: {path} exists and is not a socket; remove or rename it")


def _network() -> str:
    """Return this process's network namespace: ``127.0.0.1`` differs between namespaces."""
    try:
        return str(NETWORK.stat().st_ino)
    except OSError:
        return ""
