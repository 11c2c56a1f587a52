"""An integrator on another computer: the stack of docs/integrate.md with its certificates."""

import contextlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from common.config import Sources, load
from common.settings import Shared
from tests.docs.integrator import PAGE, Integrator, running_integrator
from verification.harness.certificates import ADDRESS, Site
from verification.harness.ports import free_port

ROBOT = "tls/192.168.201.1:7447"  # in planner.json5 of the page
DRIVER = "driver.planner"  # likewise
FILES = {
    "ca": "ca.pem",
    "certificate": "certificate.pem",
    "private_key": "private.key",
    "members": "members.json",
}


@dataclass
class Secured:
    """A stack with certificates, and its endpoint for other computers."""

    integrator: Integrator
    endpoint: str

    def configuration(self, member: str = DRIVER) -> str:
        """Write the page's Zenoh configuration for a member; return its name."""
        folder = self.integrator.folder
        text = (folder / "planner.json5").read_text(encoding="utf-8")
        assert ROBOT in text
        text = text.replace(ROBOT, self.endpoint).replace(DRIVER, f"keys/{member}")
        (folder / f"{member}.json5").write_text(text, encoding="utf-8")
        return f"{member}.json5"

    def bus_toml(self, member: str) -> Path:
        """Return the settings file of a member; it connects to this stack's port."""
        file = self.integrator.folder / "keys" / member / "bus.toml"
        bus = load(Shared, Sources(files=(file,), environ={})).config.bus
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace(bus.connect[0], self.endpoint), encoding="utf-8")
        return file


@contextlib.contextmanager
def secured_integrator(folder: Path) -> Iterator[Secured]:
    """Run a stack whose router admits the members that the page issues."""
    site = Site(folder / "keys")
    site.keys("issue", "robot", "001", "--address", ADDRESS)
    issued = re.findall(r"^t2 keys (issue .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(issued) == 3
    for words in issued:
        site.keys(*words.split())
    remote = f"tls/{ADDRESS}:{free_port()}"
    robot = site.folder / "robot.001"
    sets = [f"bus.{name}={robot / file}" for name, file in FILES.items()]
    listen = f"unixsock-stream/{folder}/bus.sock,{remote}"
    with running_integrator(folder, sets=sets, listen=listen) as it:
        yield Secured(it, remote)
