"""Diagnosis of certificates: the invalid one, and its remedy."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from cli.inspect import remedies
from cli.inspect.doctor import findings
from common.settings import BusSettings, Shared
from verification.harness.certificates import Site, connecting


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return Site(tmp_path_factory.mktemp("ours") / "keys")


@pytest.fixture(scope="module")
def stranger(tmp_path_factory: pytest.TempPathFactory) -> BusSettings:
    """Return a certificate of another site."""
    elsewhere = Site(tmp_path_factory.mktemp("theirs") / "keys")
    return elsewhere.member("driver", "mallory", "--robot", "001")


@pytest.fixture(scope="module")
def driver(site: Site) -> BusSettings:
    return site.member("driver", "anna", "--robot", "001")


@pytest.fixture(scope="module")
def endpoint(site: Site, driver: BusSettings) -> Iterator[str]:
    with site.router(site.member("robot", "001", "--address", "127.0.0.1")) as (secured, _):
        yield secured


def found(member: BusSettings, endpoint: str) -> list[tuple[str, str, str]]:
    """Return place, level and text of the findings."""
    config = Shared(bus=connecting(member, endpoint))
    return [(each.where, each.level, each.text) for each in findings(config, 0.5)]


def test_a_valid_certificate(driver: BusSettings, endpoint: str) -> None:
    first, *rest = found(driver, endpoint)
    assert first[:2] == ("network", "ok")
    assert ("router", "ok") in {each[:2] for each in rest}


def test_a_router_of_another_site(stranger: BusSettings, endpoint: str) -> None:
    (where, level, text), *_ = found(stranger, endpoint)
    assert (where, level) == ("network", "wrong")
    assert f"{endpoint}: the router's certificate is not trusted: " in text


def test_a_certificate_of_another_site(
    stranger: BusSettings, driver: BusSettings, endpoint: str
) -> None:
    mixed = msgspec.structs.replace(stranger, ca=driver.ca)
    config = Shared(bus=connecting(mixed, endpoint))
    first, *_ = findings(config, 0.5)
    assert first.level == "wrong"
    assert f"{endpoint}: the router refuses this certificate: " in first.text
    assert first.todo == remedies.KEYS


def test_a_router_at_an_address_that_its_certificate_lacks(
    driver: BusSettings, endpoint: str
) -> None:
    (_, level, text), *_ = found(driver, endpoint.replace("127.0.0.1", "127.0.0.2"))
    assert level == "wrong"
    assert "127.0.0.2" in text


def test_invalid_files(driver: BusSettings, endpoint: str, tmp_path: Path) -> None:
    missing = msgspec.structs.replace(driver, private_key=str(tmp_path / "no.key"))
    (_, level, text), *_ = found(missing, endpoint)
    assert level == "wrong"
    assert "bus.private_key is invalid: No such file or directory" in text
