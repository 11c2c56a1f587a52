"""All eight sonars: each sample once, and nothing from an old one."""

import math

from common.freshness import Latest, S
from common.messages import Ultrasonic
from common.settings import Vehicle
from services.safety.config import Safety
from services.safety.ears import Ears, Heard
from services.safety.sonar import Rules
from services.safety.twist import Twist
from services.safety.zones import zones
from tests.safety.scene import FREE, NO_ECHO

EARS = Ears(zones(Vehicle(), Safety()), Rules(0.05, 0.5), age_s=0.3)
STEP_NS = S // 20


def sample(seq: int, front: float | None = None, boot: int = 1) -> Latest[Ultrasonic]:
    ranges, status = list(FREE), list(NO_ECHO)
    if front is not None:
        ranges[2], status[2] = front, "ok"
    message = Ultrasonic(ranges=tuple(ranges), status=tuple(status), seq=seq, boot=boot)
    return Latest(message, seq * STEP_NS)


def hear(count: int, front: float | None = None, linear: float = 0.0) -> Heard:
    heard = Heard()
    for seq in range(1, count + 1):
        heard = EARS.hear(heard, sample(seq, front), Twist(linear), seq * STEP_NS)
    return heard


def test_three_samples_open_all_sectors() -> None:
    assert hear(2).faults == "all silent"
    assert hear(3).faults == ""
    assert hear(3, 1.0).distances[2] == 1.0


def test_one_sample_is_taken_once() -> None:
    heard = hear(2)
    for _ in range(3):
        heard = EARS.hear(heard, sample(2), Twist(), 2 * STEP_NS)
    assert heard.faults == "all silent"


def test_an_old_sample_closes_all_sectors_and_its_repetition_opens_none() -> None:
    heard, old = hear(3), sample(3)
    limit_ns = 3 * STEP_NS + round(0.3 * S)
    assert EARS.hear(heard, old, Twist(), limit_ns).faults == ""
    heard = EARS.hear(heard, old, Twist(), limit_ns + 1)
    assert heard.distances == (0.0,) * 8
    assert EARS.hear(heard, old, Twist(), 3 * STEP_NS).distances == (0.0,) * 8
    assert EARS.hear(heard, None, Twist(), 3 * STEP_NS).distances == (0.0,) * 8


def test_a_stuck_sonar_is_found_by_the_way_along_its_axis() -> None:
    assert hear(13, 2.0, linear=1.0).faults == "front stuck"
    assert hear(13, 2.0, linear=0.5).faults == ""
    heard = hear(13, 2.0, linear=1.0)
    assert [math.isinf(one) for one in heard.distances].count(True) == 7


def test_an_unknown_speed_is_no_motion() -> None:
    heard = Heard()
    for seq in range(1, 30):
        heard = EARS.hear(heard, sample(seq, 2.0), None, seq * STEP_NS)
    assert heard.faults == ""
