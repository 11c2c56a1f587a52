"""The exporter's settings: of whom it tells, and to whom."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from services.metrics.config import Metrics, MetricsConfig


def given(*sets: str) -> Metrics:
    words = [f"metrics.{text}" for text in sets]
    return load(MetricsConfig, Sources(environ={}, sets=words)).config.metrics


def test_as_shipped_it_tells_this_machine_alone() -> None:
    assert given() == Metrics()
    assert Metrics().host == "127.0.0.1"
    assert Metrics().port == 9317


@pytest.mark.parametrize("host", ["0.0.0.0", "10.7.5.220", "::"])
def test_a_host_that_others_reach_must_be_owned_up_to(host: str) -> None:
    with pytest.raises(
        ConfigError, match=r"metrics: host .* tells everybody .* in unsafe_overrides"
    ):
        given(f"host={host}")
    assert given(f"host={host}", "unsafe_overrides=host").host == host


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.9", "::1"])
def test_this_machine_has_several_addresses(host: str) -> None:
    assert given(f"host={host}").host == host


def test_a_name_is_no_host() -> None:
    with pytest.raises(ConfigError, match="host is 'localhost', allowed is an IP address"):
        given("host=localhost")


def test_only_what_takes_a_protection_away_can_be_accepted() -> None:
    with pytest.raises(
        ConfigError, match="unsafe_overrides names 'port', which takes no protection away"
    ):
        given("unsafe_overrides=port")


@pytest.mark.parametrize("robots", ["", "*", "001", "berlin-$*", "$*-007", "a$*b"])
def test_robots_are_an_id_or_an_expression_of_ids(robots: str) -> None:
    assert given(f"robots={robots}").robots == robots


@pytest.mark.parametrize("robots", ["**", "$*", "a*", "a/b", "$*$*", "a b", "@x", "a$"])
def test_what_is_no_chunk_of_a_key_expression_is_refused(robots: str) -> None:
    with pytest.raises(ConfigError, match=r"metrics\.robots"):
        given(f"robots={robots}")
