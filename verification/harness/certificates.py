"""A site with a CA and certificates, issued by ``t2 keys``."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

import msgspec

from cli.__main__ import main
from cli.keys import members
from cli.keys.access import RouterSettings, access_control
from common.bus.session import router
from common.settings import BusSettings
from verification.harness.ports import free_port

ADDRESS = "127.0.0.1"


class Site:
    """A CA and its members in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.keys("init", "--site", "berlin")

    def keys(self, *words: str) -> None:
        """Run ``t2 keys`` on this site's folder."""
        assert main(["keys", *words, "--folder", str(self.folder)]) == 0

    def member(self, role: str, name: str, *options: str) -> BusSettings:
        """Issue a certificate, and return the settings that use it; without an endpoint."""
        self.keys("issue", role, name, *options)
        return self.settings(role, name)

    def settings(self, role: str, name: str) -> BusSettings:
        """Return the settings that use a certificate."""
        mine = self.folder / f"{role}.{name}"
        return BusSettings(
            ca=str(mine / "ca.pem"),
            certificate=str(mine / "certificate.pem"),
            private_key=str(mine / "private.key"),
            members=str(self.folder / "members.json"),
        )

    @contextlib.contextmanager
    def router(self, of: BusSettings, *uplink: str) -> Iterator[tuple[str, str]]:
        """Run a router with this certificate; yield its TLS and its local endpoint."""
        secured = f"tls/{ADDRESS}:{free_port()}"
        onboard = f"unixsock-stream/{self.folder}/bus-{free_port()}.sock"
        where = msgspec.structs.replace(of, listen=(secured, onboard), uplink=uplink)
        listed = members.read(Path(of.members)).welcome
        with router(where, access_control(listed, ["unixsock-stream"], RouterSettings())):
            yield secured, onboard


def connecting(member: BusSettings, endpoint: str) -> BusSettings:
    """Return the settings of a member that connects to an endpoint."""
    return msgspec.structs.replace(member, connect=(endpoint,))
