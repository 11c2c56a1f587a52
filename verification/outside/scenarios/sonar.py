"""Constant sonars: group 11."""

import time

from verification.outside.clients import STATE
from verification.outside.stack import wait_for
from verification.outside.testbed import Result, Testbed, scenario

CREEP_MPS = 0.15
LEFT, FRONT_LEFT, FRONT, FRONT_RIGHT, REAR_LEFT = 0, 1, 2, 3, 7


def mobility(bed: Testbed, linear: float) -> Result:
    """Drive on for 6 s beside constant sonars, then back, then turn."""
    vehicle = bed.board.vehicle
    with bed.source() as source:
        begin = time.monotonic()
        source.request(linear)
        time.sleep(4.0)
        late = vehicle.distance
        time.sleep(2.0)
        forward = (vehicle.distance - late) / 2.0
        still = time.monotonic() - begin
        text = bed.observer.last(STATE)["text"]
        source.request(-0.2)
        back = wait_for(lambda: vehicle.linear < -0.05, 3.0)
        source.request(0.0, 0.3)
        turn = wait_for(lambda: abs(vehicle.angular) > 0.1, 3.0)
    moves = f"{forward:.2f} m/s over the last 2 of {still:.0f} s"
    ways = f"back: {'yes' if back else 'no'}, turn: {'yes' if turn else 'no'}"
    why = f"; {text}" if forward < CREEP_MPS - 0.02 else ""
    return Result(f"{moves}; {ways}{why}", forward >= CREEP_MPS - 0.02 and back and turn)


@scenario(
    11,
    "along a wall: left 0.57 m, both left corners 0.80 m, exactly constant; 0.35 m/s",
    "still 0.15 m/s or more after 6 s; then backward and turning",
)
def beside_wall(bed: Testbed) -> Result:
    bed.board.sonars[LEFT] = 570
    bed.board.sonars[FRONT_LEFT] = bed.board.sonars[REAR_LEFT] = 800
    return mobility(bed, 0.35)


@scenario(
    11,
    "the three front sonars saturate at 4.5 m; 0.5 m/s",
    "still 0.15 m/s or more after 6 s; then backward and turning",
)
def saturated_front(bed: Testbed) -> Result:
    for index in (FRONT_LEFT, FRONT, FRONT_RIGHT):
        bed.board.sonars[index] = 4500
    return mobility(bed, 0.5)


@scenario(
    11,
    "the front sonar reports 0xFFFF; 0.3 m/s forward, then backward",
    "no RUN forward; backward drives",
)
def faulty_front(bed: Testbed) -> Result:
    bed.board.sonars[FRONT] = 0xFFFF
    time.sleep(0.5)
    begin = time.monotonic()
    with bed.source() as source:
        source.request(0.3)
        time.sleep(2.0)
        forward = bed.runs(begin, 1)
        source.request(-0.2)
        back = wait_for(lambda: bed.speed() < -0.15, 3.0)
    return Result(f"{len(forward)} RUN forward; back: {'yes' if back else 'no'}",
                  not forward and back)  # fmt: skip


@scenario(
    11,
    "the front sonar alone sticks at 1.2 m; 0.5 m/s for 3 m; then it works again",
    "0.15 m/s at most, and not immobile; over 0.3 m/s again within 5 s",
)
def stuck_front(bed: Testbed) -> Result:
    vehicle = bed.board.vehicle
    for index in (FRONT_LEFT, FRONT_RIGHT):
        bed.board.sonars[index] = 3000
    with bed.source() as source:
        bed.board.sonars[FRONT] = 1200
        source.request(0.5)
        begin, travelled = vehicle.distance, 0.0
        end = time.monotonic() + 8.0
        while time.monotonic() < end and travelled < 2.0:
            time.sleep(0.02)  # the neighbours see the wall come nearer, the front does not
            travelled = vehicle.distance - begin
            for index in (FRONT_LEFT, FRONT_RIGHT):
                bed.board.sonars[index] = round(3000 - 1000 * travelled)
        late, at = vehicle.distance, time.monotonic()
        time.sleep(2.0)
        speed = (vehicle.distance - late) / (time.monotonic() - at)
        text = bed.observer.last(STATE)["text"]
        bed.board.sonars[FRONT_LEFT : FRONT_RIGHT + 1] = [4000, 4000, 4000]
        end, at = time.monotonic() + 5.0, vehicle.distance
        while time.monotonic() < end and vehicle.linear < 0.3:
            time.sleep(0.02)
            ahead = 4000 - round(1000 * (vehicle.distance - at))
            bed.board.sonars[FRONT_LEFT : FRONT_RIGHT + 1] = [ahead] * 3
        again = vehicle.linear >= 0.3
    ok = 0.05 <= speed <= CREEP_MPS + 0.02 and again
    found = f"{speed:.2f} m/s ({text}) after {travelled:.1f} m; {'' if again else 'not '}recovered"
    return Result(found, ok)
