"""Zenoh's own TLS against our certificates: whom it lets in, and whom it believes.

What somebody may do once he is in is tested elsewhere (``tests/cli/keys/test_rights.py``).
"""

import contextlib
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

from cli.keys.ca import Authority
from cli.keys.profile import DAY_S, Profile, Span, profile
from cli.keys.store import locked
from common.bus.session import client_config, router
from common.config import Sources, load
from common.errors import LinkError
from common.members import Members
from common.settings import BusSettings, Shared
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

KEY = "t2/v1/001/tel/bridge/velocity"
ROBOT = profile("robot", "001", (), ())
DRIVER = profile("driver", "anna", ("001",), ())


class Site:
    """An authority in a folder, whose certificates last as long as a test wants."""

    def __init__(self, folder: Path) -> None:
        self.now_s = time.time()
        self.authority = Authority.found("berlin", Span(self.now_s - DAY_S, self.now_s + DAY_S))
        with locked(folder, create=True) as self.folder:
            self.folder.found(self.authority, Members(site="berlin"), b"")

    def bus(self, who: Profile, begins_s: float = -60, ends_s: float = 3600) -> BusSettings:
        """Return the settings of somebody whose certificate is good from then on until then."""
        valid = Span(self.now_s + begins_s, self.now_s + ends_s)
        issued = self.authority.issue(who, valid)
        listed = Members(site="berlin", members=(*self.folder.read().members, issued.member))
        target = self.folder.hand_out(who, issued, listed, settings=True)
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
    """Run a router with these files, on loopback; yield its endpoint."""
    endpoint = f"tls/127.0.0.1:{free_port()}"
    with router(msgspec.structs.replace(bus, listen=(endpoint,))):
        yield endpoint


@pytest.fixture(scope="module")
def endpoint(site: Site) -> Iterator[str]:
    with listening(site.bus(ROBOT)) as where:
        yield where


def dial(bus: BusSettings, endpoint: str, **tls: Any) -> zenoh.Session:
    """Open a session, with other TLS settings if told; raise ``ZError`` if that cannot be."""
    config = client_config(msgspec.structs.replace(bus, connect=(endpoint,)))
    if tls:
        whole = json.loads(config.get_json("transport/link/tls")) | tls
        config.insert_json5("transport/link/tls", json.dumps(whole))
    return zenoh.open(config)


def test_a_member_gets_in_and_is_heard(site: Site, endpoint: str) -> None:
    with dial(site.bus(DRIVER), endpoint) as one, dial(site.bus(ROBOT), endpoint) as other:
        heard = other.declare_subscriber(KEY, zenoh.handlers.RingChannel(1))

        def said() -> zenoh.Sample | None:
            one.put(KEY, b"hello")
            return heard.try_recv()

        sample = wait_until(said, "a sample through the router")
        assert sample is not None
        assert sample.payload.to_bytes() == b"hello"


@pytest.mark.parametrize("where", ["127.0.0.1", "localhost"])
def test_a_router_is_believed_at_each_of_its_addresses(
    where: str, site: Site, endpoint: str
) -> None:
    port = endpoint.rpartition(":")[2]
    with dial(site.bus(DRIVER), f"tls/{where}:{port}") as session:
        assert list(session.info.routers_zid())


def without_a_certificate(site: Site, _: Site, endpoint: str) -> zenoh.Session:
    return dial(site.bus(DRIVER), endpoint, enable_mtls=False)


def of_a_foreign_authority(site: Site, stranger: Site, endpoint: str) -> zenoh.Session:
    """One of the same name, whose holder believes our router."""
    ours = site.bus(DRIVER)
    return dial(msgspec.structs.replace(stranger.bus(DRIVER), ca=ours.ca), endpoint)


def ended(site: Site, _: Site, endpoint: str) -> zenoh.Session:
    return dial(site.bus(DRIVER, begins_s=-3600, ends_s=-60), endpoint)


def not_yet_good(site: Site, _: Site, endpoint: str) -> zenoh.Session:
    return dial(site.bus(DRIVER, begins_s=600, ends_s=3600), endpoint)


def of_another_key(site: Site, _: Site, endpoint: str) -> zenoh.Session:
    mine = site.bus(DRIVER)
    key = Path(mine.private_key).read_bytes()
    site.bus(DRIVER)  # the same folder, a new key
    Path(mine.private_key).write_bytes(key)
    return dial(mine, endpoint)


@pytest.mark.parametrize(
    "tried",
    [without_a_certificate, of_a_foreign_authority, ended, not_yet_good, of_another_key],
    ids=lambda tried: tried.__name__,
)
def test_who_is_kept_out(
    tried: Callable[[Site, Site, str], zenoh.Session], site: Site, stranger: Site, endpoint: str
) -> None:
    with pytest.raises(zenoh.ZError), tried(site, stranger, endpoint):
        pass
    with dial(site.bus(DRIVER), endpoint):  # nothing else was in the way
        pass


def test_a_laptop_believes_no_router_of_a_foreign_authority(site: Site, stranger: Site) -> None:
    with listening(stranger.bus(ROBOT)) as endpoint:
        with pytest.raises(zenoh.ZError):
            dial(site.bus(DRIVER), endpoint)
        with dial(stranger.bus(DRIVER), endpoint):
            pass


def test_a_laptop_believes_no_driver_who_pretends_to_be_a_router(site: Site) -> None:
    guest = site.bus(profile("viewer", "guest", (), ()))
    pretending = msgspec.structs.replace(site.bus(DRIVER), members="unused")
    # At any address: a driver's certificate names none, but it is also for dialling only.
    with listening(pretending) as endpoint, pytest.raises(zenoh.ZError):
        dial(guest, endpoint, verify_name_on_connect=False)
    with (
        listening(site.bus(ROBOT)) as endpoint,
        dial(guest, endpoint, verify_name_on_connect=False),
    ):
        pass  # nothing else was in the way


def test_a_laptop_believes_a_router_at_its_own_addresses_only(site: Site) -> None:
    elsewhere = profile("robot", "002", (), ("192.0.2.7",))
    issued = Profile("robot", "002", ("002",), elsewhere.addresses[:1])
    with listening(site.bus(issued)) as endpoint:
        with pytest.raises(zenoh.ZError):
            dial(site.bus(DRIVER), endpoint)
        with dial(site.bus(DRIVER), endpoint, verify_name_on_connect=False):
            pass  # nothing else was in the way


def test_a_link_ends_with_its_certificate(site: Site, endpoint: str) -> None:
    brief = Site.__new__(Site)
    brief.now_s, brief.authority, brief.folder = time.time(), site.authority, site.folder
    with dial(brief.bus(DRIVER, ends_s=3.0), endpoint) as session:
        assert list(session.info.routers_zid())
        wait_until(lambda: not list(session.info.routers_zid()), "the end of the link")


def test_a_router_without_its_files_says_so(site: Site, tmp_path: Path) -> None:
    broken = tmp_path / "broken.pem"
    broken.write_text("no certificate", encoding="utf-8")
    bus = msgspec.structs.replace(site.bus(ROBOT), certificate=str(broken))
    with pytest.raises(LinkError, match="the router cannot listen"), listening(bus):
        pass
