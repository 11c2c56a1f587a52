"""Zenoh's TLS with our certificates: accepted and rejected clients and routers.

The rights of accepted clients are tested in ``tests/cli/keys/test_rights.py``.
"""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

from cli.keys.members import Profile
from cli.keys.store import Folder
from common.bus.session import client_config
from common.settings import BusSettings
from verification.harness.certificates import Site, connecting
from verification.harness.waiting import wait_until

DRIVER = ("driver", "anna", "--robot", "001")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    made = Site(tmp_path_factory.mktemp("site") / "keys")
    made.member("robot", "001", "--address", "127.0.0.1")
    made.member(*DRIVER)
    return made


@pytest.fixture(scope="module")
def anna(site: Site) -> BusSettings:
    return site.settings("driver", "anna")


@pytest.fixture(scope="module")
def endpoint(site: Site) -> Iterator[str]:
    with site.router(site.settings("robot", "001")) as (where, _):
        yield where


def connect(bus: BusSettings, endpoint: str, **tls: Any) -> zenoh.Session:
    """Open a session, with changed TLS settings; raise ``ZError`` if it is rejected."""
    config = client_config(connecting(bus, endpoint))
    if tls:
        whole = json.loads(config.get_json("transport/link/tls")) | tls
        config.insert_json5("transport/link/tls", json.dumps(whole))
    return zenoh.open(config)


def test_rejected_clients(anna: BusSettings, endpoint: str, tmp_path: Path) -> None:
    """Without a certificate; of another authority with the same name, and trust in our router."""
    with pytest.raises(zenoh.ZError):
        connect(anna, endpoint, enable_mtls=False)
    stranger = Site(tmp_path / "keys").member(*DRIVER)
    with pytest.raises(zenoh.ZError):
        connect(msgspec.structs.replace(stranger, ca=anna.ca), endpoint)
    with connect(anna, endpoint):  # a valid client is accepted
        pass


def test_a_client_rejects_a_driver_as_router(site: Site, anna: BusSettings, endpoint: str) -> None:
    guest = site.member("viewer", "guest")
    # Without address check: a driver's certificate has no address, and is for clients only.
    with site.router(anna) as (pretending, _), pytest.raises(zenoh.ZError):
        connect(guest, pretending, verify_name_on_connect=False)
    with connect(guest, endpoint, verify_name_on_connect=False):
        pass  # a router's certificate is accepted


def issue(site: Site, who: Profile, ends_s: float) -> BusSettings:
    """Issue a certificate that `t2 keys` does not: for this profile, valid until ``ends_s``."""
    folder = Folder(site.folder)
    issued = folder.authority(bytes).issue(who, (time.time() - 60, time.time() + ends_s))
    folder.write_machine(issued, folder.read(), settings=True)
    return site.settings(who.role, who.name)


def test_a_client_rejects_a_router_at_another_address(site: Site, anna: BusSettings) -> None:
    elsewhere = Profile(role="robot", name="002", robots=("002",), addresses=("192.0.2.7",))
    with site.router(issue(site, elsewhere, 3600.0)) as (moved, _):
        with pytest.raises(zenoh.ZError):
            connect(anna, moved)
        with connect(anna, moved, verify_name_on_connect=False):
            pass  # a valid client is accepted


def test_a_link_ends_when_its_certificate_expires(site: Site, endpoint: str) -> None:
    brief = issue(site, Profile(role="driver", name="brief", robots=("001",)), 3.0)
    with connect(brief, endpoint) as session:
        assert list(session.info.routers_zid())
        wait_until(lambda: not list(session.info.routers_zid()), "the end of the link")
