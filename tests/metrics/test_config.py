"""The exporter's settings."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from services.metrics.config import Metrics, MetricsConfig


def given(*sets: str) -> Metrics:
    words = [f"metrics.{text}" for text in sets]
    return load(MetricsConfig, Sources(environ={}, sets=words)).config.metrics


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
def test_a_public_host_needs_an_override(host: str) -> None:
    with pytest.raises(
        ConfigError, match=r"metrics: host .* serves the network .* in unsafe_overrides"
    ):
        given(f"host={host}")
    assert given(f"host={host}", "unsafe_overrides=host").host == host


@pytest.mark.parametrize("host", ["127.0.0.9", "::1"])
def test_every_loopback_address_is_allowed(host: str) -> None:
    assert given(f"host={host}").host == host


def test_a_host_name_is_rejected() -> None:
    with pytest.raises(ConfigError, match="host is 'localhost', allowed is an IP address"):
        given("host=localhost")


def test_only_protected_settings_can_be_overridden() -> None:
    with pytest.raises(
        ConfigError, match="unsafe_overrides names 'port', which is not a protected setting"
    ):
        given("unsafe_overrides=port")


@pytest.mark.parametrize("robots", ["", "*", "001", "berlin-$*", "$*-007", "a$*b"])
def test_robots_is_an_id_or_an_expression(robots: str) -> None:
    assert given(f"robots={robots}").robots == robots


@pytest.mark.parametrize("robots", ["**", "$*", "a*", "a/b", "$*$*", "a b", "@x", "a$"])
def test_invalid_key_expressions_are_rejected(robots: str) -> None:
    with pytest.raises(ConfigError, match=r"metrics\.robots"):
        given(f"robots={robots}")
