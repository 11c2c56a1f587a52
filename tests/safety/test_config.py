"""Settings: the file is the defaults, and a protection is not taken away by accident."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from services.safety.config import LimitSource, Safety, SafetyConfig, Source


def read(*sets: str) -> Safety:
    return load(SafetyConfig, Sources(environ={}, sets=sets)).config.safety


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("margin", 0.04),
        ("margin", 0.0),
        ("react", 0.09),
        ("deceleration", 0.09),
        ("angular_deceleration", 0.09),
        ("max_linear", 1.51),
        ("stall", 0.01),
        ("release_speed", 0.2),
        ("require_switches", False),
        ("sources.nav.lease", 0.51),
        ("sources.nav.operator", True),
        ("creep_speed", 0.26),
    ],
)
def test_what_takes_a_protection_away_must_be_owned_up_to(name: str, value: object) -> None:
    slow = "safety.max_linear=0.5"  # it must see as far as it takes to stop
    given = slow, f"safety.{name}={str(value).lower()}"
    with pytest.raises(ConfigError, match=f"{name} = .* or name it in unsafe_overrides"):
        read(*given)
    assert read(*given, f"safety.unsafe_overrides={name}").unsafe_overrides == (name,)


def test_an_emergency_stop_is_kept_alive_by_a_source_once() -> None:
    with pytest.raises(ConfigError, match="estop_keepalive names a source twice"):
        read('safety.estop_keepalive=["pendant", "pendant"]')


@pytest.mark.parametrize(
    "name", ["creep_speed", "estop_keepalive_timeout", "max_linear", "sources.teleop.lease"]
)
def test_zero_never_means_off(name: str) -> None:
    with pytest.raises(ConfigError, match=name.split(".")[0]):
        read(f"safety.{name}=0", f"safety.unsafe_overrides={name}")


def test_priorities_are_unique() -> None:
    with pytest.raises(ConfigError, match=r"sources teleop and web have the same priority"):
        read("safety.sources.web.priority=30")
    assert read("safety.sources.web.priority=5").sources["web"] == Source(
        priority=5, lease=0.3, operator=True
    )


def test_it_must_see_as_far_as_it_takes_to_stop() -> None:
    with pytest.raises(ConfigError, match=r"sonar_max 1.2 m is too near: .* in 1.28 m"):
        read("vehicle.sonar_max=1.2")
    assert read("vehicle.sonar_max=1.2", "safety.max_linear=0.9").max_linear == 0.9


def test_a_limit_source_has_both_settings_and_a_short_lease() -> None:
    given = 'safety.limits.lidar={lease = 0.5, silence = "stop"}'
    assert read(given).limits == {"lidar": LimitSource(lease=0.5, silence="stop")}
    for wrong, message in (
        ("safety.limits.lidar={lease = 0.5}", "silence"),
        ('safety.limits.lidar={silence = "stop"}', "lease"),
        ('safety.limits.lidar={lease = 0.5, silence = "drive"}', "silence"),
        ('safety.limits.lidar={lease = 1.1, silence = "stop"}', "limits.lidar.lease"),
        ('safety.limits."a/b"={lease = 0.5, silence = "stop"}', "limits"),
    ):
        with pytest.raises(ConfigError, match=message):
            read(wrong)
