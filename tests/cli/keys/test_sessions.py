"""Zenoh's TLS with our certificates: accepted and rejected clients and routers.

The rights of accepted clients are tested in ``tests/cli/keys/test_rights.py``.
"""

import contextlib
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

from cli.keys.ca import CertificateAuthority
from cli.keys.member_list import DAY_S, profile
from cli.keys.store import locked
from common.bus.session import client_config, router
from common.config import Sources, load
from common.members import Members, Profile
from common.settings import BusSettings, Shared
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

ROBOT = profile("robot", "001")
DRIVER = profile("driver", "anna", ("001",))


class Site:
    """An authority in a folder, for certificates of any validity."""

    def __init__(self, folder: Path) -> None:
        self.now_s = time.time()
        self.authority = CertificateAuthority.create(
            "berlin", (self.now_s - DAY_S, self.now_s + DAY_S)
        )
        with locked(folder, create=True) as self.folder:
            self.folder.create_authority(self.authority, Members(site="berlin"), b"")

    def bus(self, who: Profile, begins_s: float = -60, ends_s: float = 3600) -> BusSettings:
        """Return the settings of a member with a certificate of this validity, relative to now."""
        valid = self.now_s + begins_s, self.now_s + ends_s
        issued = self.authority.issue(who, valid)
        listed = Members(site="berlin", members=(*self.folder.read().members, issued.member))
        target = self.folder.write_machine(issued, listed, settings=True)
        self.folder.write(listed)
        return load(Shared, Sources(files=(target / "bus.toml",), environ={})).config.bus


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return Site(tmp_path_factory.mktemp("site") / "keys")


@pytest.fixture(scope="module")
def stranger(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return Site(tmp_path_factory.mktemp("stranger") / "keys")


@contextlib.contextmanager
def listening(bus: BusSettings) -> Iterator[str]:
    """Run a router with these settings on loopback; yield its endpoint."""
    endpoint = f"tls/127.0.0.1:{free_port()}"
    with router(msgspec.structs.replace(bus, listen=(endpoint,))):
        yield endpoint


@pytest.fixture(scope="module")
def endpoint(site: Site) -> Iterator[str]:
    with listening(site.bus(ROBOT)) as where:
        yield where


def connect(bus: BusSettings, endpoint: str, **tls: Any) -> zenoh.Session:
    """Open a session, with changed TLS settings; raise ``ZError`` if it is rejected."""
    config = client_config(msgspec.structs.replace(bus, connect=(endpoint,)))
    if tls:
        whole = json.loads(config.get_json("transport/link/tls")) | tls
        config.insert_json5("transport/link/tls", json.dumps(whole))
    return zenoh.open(config)


def test_rejected_clients(site: Site, stranger: Site, endpoint: str) -> None:
    """Without a certificate; of another authority with the same name, and trust in our router."""
    ours = site.bus(DRIVER)
    with pytest.raises(zenoh.ZError):
        connect(ours, endpoint, enable_mtls=False)
    with pytest.raises(zenoh.ZError):
        connect(msgspec.structs.replace(stranger.bus(DRIVER), ca=ours.ca), endpoint)
    with connect(ours, endpoint):  # a valid client is accepted
        pass


def test_a_client_rejects_a_driver_as_router(site: Site) -> None:
    guest = site.bus(profile("viewer", "guest"))
    pretending = msgspec.structs.replace(site.bus(DRIVER), members="unused")
    # Without address check: a driver's certificate has no address, and is for clients only.
    with listening(pretending) as endpoint, pytest.raises(zenoh.ZError):
        connect(guest, endpoint, verify_name_on_connect=False)
    with (
        listening(site.bus(ROBOT)) as endpoint,
        connect(guest, endpoint, verify_name_on_connect=False),
    ):
        pass  # a valid client is accepted


def test_a_client_rejects_a_router_at_another_address(site: Site) -> None:
    issued = Profile(role="robot", name="002", robots=("002",), addresses=("192.0.2.7",))
    with listening(site.bus(issued)) as endpoint:
        with pytest.raises(zenoh.ZError):
            connect(site.bus(DRIVER), endpoint)
        with connect(site.bus(DRIVER), endpoint, verify_name_on_connect=False):
            pass  # a valid client is accepted


def test_a_link_ends_when_its_certificate_expires(site: Site, endpoint: str) -> None:
    brief = Site.__new__(Site)
    brief.now_s, brief.authority, brief.folder = time.time(), site.authority, site.folder
    with connect(brief.bus(DRIVER, ends_s=3.0), endpoint) as session:
        assert list(session.info.routers_zid())
        wait_until(lambda: not list(session.info.routers_zid()), "the end of the link")
