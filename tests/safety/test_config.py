"""Settings: the file is the defaults, and a protection is not taken away by accident."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from services.safety.config import LimitSource, Safety, SafetyConfig, Source


def configured(*sets: str) -> SafetyConfig:
    return load(SafetyConfig, Sources(environ={}, sets=sets)).config


def read(*sets: str) -> Safety:
    return configured(*sets).safety


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("safety.margin", 0.04),
        ("safety.margin", 0.0),
        ("safety.react", 0.09),
        ("vehicle.deceleration", 0.09),
        ("vehicle.deceleration", 1.01),
        ("vehicle.angular_deceleration", 0.09),
        ("vehicle.angular_deceleration", 3.01),
        ("vehicle.max_angular", 2.01),
        ("host.stall", 0.01),
        ("board.require_switches", False),
        ("safety.linear_acceleration", 1.51),
        ("safety.angular_acceleration", 4.01),
        ("safety.release_speed", 0.2),
        ("safety.release_distance", 0.31),
        ("safety.sources.nav.lease", 0.51),
        ("safety.sources.nav.operator", True),
        ("safety.creep_speed", 0.26),
    ],
)
def test_what_takes_a_protection_away_must_be_owned_up_to(path: str, value: object) -> None:
    slow = "vehicle.max_linear=0.5"  # it must see as far as it takes to stop
    given = slow, f"{path}={str(value).lower()}"
    with pytest.raises(ConfigError, match=f"{path} = .* or name '{path}' in unsafe_overrides"):
        read(*given)
    assert configured(*given, f"unsafe_overrides={path}").unsafe_overrides == (path,)


def test_the_screens_are_held_by_an_operator_without_an_override() -> None:
    for name in ("teleop", "checkout", "web"):
        assert f"sources.{name}.operator" not in read().protections()
    assert "sources.nav.operator" in read().protections()


def test_an_emergency_stop_may_be_kept_alive_more_slowly_than_a_limit() -> None:
    for silence, longest in (("stop", 1.0), ("ignore", 1.0), ("latch", 2.0)):
        given = 'safety.limits.it={{lease = {}, silence = "{}"}}'
        read(given.format(longest, silence))
        with pytest.raises(ConfigError, match=r"safety\.limits\.it\.lease = .* takes a protection"):
            read(given.format(longest + 0.1, silence))


@pytest.mark.parametrize(
    "path",
    ["safety.creep_speed", "safety.sources.teleop.lease",
     "vehicle.max_linear", "vehicle.deceleration"],
)  # fmt: skip
def test_zero_never_means_off(path: str) -> None:
    with pytest.raises(ConfigError, match=f"{path} = 0: Expected"):
        read(f"{path}=0", f"unsafe_overrides={path}")


def test_priorities_are_unique() -> None:
    with pytest.raises(ConfigError, match=r"sources teleop and web have the same priority"):
        read("safety.sources.web.priority=30")
    assert read("safety.sources.web.priority=5").sources["web"] == Source(
        priority=5, lease=0.3, operator=True
    )


def test_it_must_see_as_far_as_it_takes_to_stop() -> None:
    with pytest.raises(ConfigError, match=r"sonar_max 1.2 m is too near: .* in 1.30 m"):
        read("vehicle.sonar_max=1.2")
    assert configured("vehicle.sonar_max=1.2", "vehicle.max_linear=0.9").vehicle.max_linear == 0.9


def test_a_limit_source_has_both_settings_and_a_short_lease() -> None:
    given = 'safety.limits.lidar={lease = 0.5, silence = "stop"}'
    read('safety.limits.web={lease = 1.0, silence = "latch"}')
    assert read(given).limits == {"lidar": LimitSource(lease=0.5, silence="stop")}
    for wrong, message in (
        ("safety.limits.lidar={lease = 0.5}", "silence"),
        ('safety.limits.lidar={silence = "stop"}', "lease"),
        ('safety.limits.lidar={lease = 0.5, silence = "drive"}', "silence"),
        ('safety.limits.lidar={lease = 1.1, silence = "stop"}', "limits.lidar.lease"),
        (
            'safety.limits.nav={lease = 0.5, silence = "stop"}',
            "limits.nav has the name of a source",
        ),
        ('safety.limits."a/b"={lease = 0.5, silence = "stop"}', "limits"),
    ):
        with pytest.raises(ConfigError, match=message):
            read(wrong)
