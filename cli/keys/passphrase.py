"""The passphrase of the authority's key: from a file, or asked on the terminal without an echo."""

import sys
from getpass import getpass
from pathlib import Path

from common.errors import ConfigError, RobotError


def new(file: Path | None, wanted: bool) -> bytes:
    """Return the passphrase for a new key; nothing if none is wanted."""
    if file:
        return _from_file(file)
    if not wanted:
        return b""
    first = _asked("passphrase for the CA's key: ")
    if not first:
        raise ConfigError("--passphrase: an empty one protects nothing")
    if _asked("once more: ") != first:
        raise ConfigError("--passphrase: these were two different ones; nothing was made")
    return first


def known(file: Path | None) -> bytes:
    """Return the passphrase of a key that is encrypted."""
    return _from_file(file) if file else _asked("passphrase of the CA's key: ")


def _from_file(file: Path) -> bytes:
    try:
        found = file.read_bytes().rstrip(b"\r\n")
    except OSError as error:
        raise ConfigError(f"--passphrase-file {file}: cannot be read: {error.strerror}") from None
    if not found:
        raise ConfigError(f"--passphrase-file {file}: is empty")
    return found


def _asked(prompt: str) -> bytes:
    if not sys.stdin.isatty():
        raise RobotError("it wants the passphrase of the CA's key: give --passphrase-file FILE")
    return getpass(prompt).encode()
