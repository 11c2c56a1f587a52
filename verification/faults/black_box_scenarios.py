"""The black-box rows. A row's name, as words, is that of its function."""

import itertools
import math
import random
import time
from collections.abc import Callable

import msgpack

from verification.faults.black_box import BRAKE_S, UNDER_WAY_S, BlackBox, Scenario
from verification.faults.independent_client import (
    BUMPER,
    HEALTH,
    MOTION,
    ODOMETRY,
    STATE,
    Map,
    session,
)
from verification.harness.waiting import becomes_true, wait_until

TICK_S = 0.02
STOPPED_S = 0.28 / 0.6 + 0.5  # v / a of the shipped settings, and what safety adds
ROLLED_M = 0.05 + 0.03  # the bound, and the reaction
LIDAR = 'safety.limits.lidar={lease = 0.5, silence = "ignore"}'
PENDANT = 'safety.estop_keepalive=["pendant"]'

Run = Callable[[BlackBox], None]
SCENARIOS: list[Scenario] = []


def scenario(given: str, when: str, then: str, *sets: str) -> Callable[[Run], Run]:
    """Add a row, with settings."""

    def add(run: Run) -> Run:
        SCENARIOS.append(Scenario(given, when, then, run, sets))
        return run

    return add


@scenario(
    "no fault",
    "0.3 m/s forward, then 0.4 rad/s to the left",
    "RUN with 300 mm/s, then with 229 tenths of a degree/s; odometry agrees with the vehicle",
)
def units_of_the_manual(box: BlackBox) -> None:
    with box.source() as driver:
        box.drive(driver, 0.3)
        time.sleep(1.0)
        straight = box.board.commands[-1]
        box.drive(driver, 0.0)
        box.drive(driver, 0.0, 0.4)
        time.sleep(1.0)
        turning = box.board.commands[-1]
        box.drive(driver, 0.0)
    sent = (straight.linear, straight.angular), (turning.linear, turning.angular)
    assert sent == ((300, 0), (0, 229)), f"sent {sent}"
    board, pose = box.board, {}

    def agrees() -> bool:
        pose.update(box.client.last(ODOMETRY))
        errors = math.hypot(pose["x"], pose["y"]) - board.distance, pose["heading"] - board.heading
        return all(abs(error) < 0.02 for error in errors)

    assert becomes_true(agrees, 1.0), f"{pose}; {board.distance:.2f} m, {board.heading:.2f} rad"


@scenario("frames of 5 ms share a datagram; 0.3 m/s", "contact", "BRAKE in time")
def merged_datagrams(box: BlackBox) -> None:
    box.board.merge_s = 0.005
    with box.driving(0.3):
        box.brakes(box.board.press())


@scenario("0.4 m/s", "contact 0x80 on the second port only", "BRAKE in time, latched, no RUN later")
def contact_of_an_odd_byte(box: BlackBox) -> None:
    with box.driving(0.4):
        at_s = box.board.press(0x80, (1,))
        box.brakes(at_s)
        time.sleep(1.0)
        box.no_run(at_s + UNDER_WAY_S)
        assert "contact" in box.client.latched, f"latched: {box.client.latched}"


@scenario(
    "0.3 m/s",
    "an emergency stop by an empty PUT; a reset with the stick held; one after the stick is let go",
    "BRAKE in time; the first reset is refused; no RUN until a neutral request after the second",
)
def estop_and_reset(box: BlackBox) -> None:
    with box.driving(0.3) as driver:
        at_s = box.client.put("estop")
        box.brakes(at_s)
        time.sleep(0.5)
        refusal = box.client.call("safety/reset", box.client.reset_request())
        assert refusal, "a reset is accepted while motion is requested"
        driver.silence()
        assert box.client.reset(), f"no reset: {box.client.state.get('text')}"
        driver.repeat(linear=0.3, angular=0.0)
        time.sleep(1.0)
        box.no_run(at_s + UNDER_WAY_S)
        driver.repeat(linear=0.0, angular=0.0)
        box.armed()
        box.drive(driver, 0.3)


@scenario(
    "a contact is latched, the bumper is free again",
    "reset, switches and pose without an echo, or with one that safety never sent; resets "
    "that name no cause, or those of an earlier contact",
    "nothing is cleared, switched or moved; only the reset of the right causes clears",
)
def calls_of_a_stranger(box: BlackBox) -> None:
    client = box.client
    earlier = latched_contact(box)
    assert client.reset(), f"the first contact is not reset: {client.state.get('text')}"
    at_s = time.monotonic()
    causes = latched_contact(box)
    calls: dict[str, Map] = {
        "safety/reset": {"causes": causes},
        "bridge/switches": {"bumper_brake": False},
        "odom/reset": {"x": 1.0},
    }
    for name, request in calls.items():
        for echo in ({}, {"echo": client.state["heartbeat"] + 1_000_000}):
            refusal = client.call(name, request | echo)
            assert refusal not in {"", "no answer"}, f"{name} {echo}: {refusal or 'done'}"
    for named in ([], earlier):
        client.call("safety/reset", client.reset_request() | {"causes": named})
    time.sleep(0.3)
    assert "contact" in client.latched, "the contact is cleared"
    assert all(box.board.brakes.values()), f"a brake of the board is off: {box.board.brakes}"
    box.no_run(at_s)
    assert client.reset(), f"the right reset clears nothing: {client.state.get('text')}"


def latched_contact(box: BlackBox) -> list[int]:
    """Press and free the bumper; return the ids of what is latched."""
    box.armed()
    box.board.press()
    wait_until(lambda: "contact" in box.client.latched, "contact latched")
    box.board.press(0)
    wait_until(lambda: not box.client.last(BUMPER)["pressed"], "bumper free")
    time.sleep(0.3)
    return list(box.client.reset_request()["causes"])


@scenario("standing", "a client, a peer and a router publish safety's RUN at 50 Hz", "no RUN")
def forged_motion(box: BlackBox) -> None:
    client = box.client
    box.armed()
    at_s, ahead = time.monotonic(), itertools.count(10_000)
    for mode in ("client", "peer", "router"):
        with session(box.endpoint, mode) as bus:
            time.sleep(0.5)
            for _ in range(40):
                seen = client.last(MOTION)
                seen |= {"seq": seen["seq"] + next(ahead), "command": "run", "linear": 0.9}
                seen |= {"judged": client.last(BUMPER)["seq"]}
                bus.put(f"t2/v1/001/{MOTION}", msgpack.packb(seen))
                time.sleep(TICK_S)
    box.no_run(at_s)


@scenario("standing", "3000 unknown names request motion", "no RUN, health below 16 kB")
def unknown_sources(box: BlackBox) -> None:
    box.armed()
    at_s, uptime_s = time.monotonic(), box.client.last(HEALTH)["uptime"]
    for number in range(3000):
        box.client.put(f"@cmd/drive/x{number}", b"\x80")
        if number % 50 == 0:
            time.sleep(TICK_S)
    wait_until(lambda: box.client.last(HEALTH)["uptime"] > uptime_s + 3, "a later health message")
    size = len(box.client.newest[HEALTH])
    assert size < 16_000, f"{size / 1000:.1f} kB"
    box.no_run(at_s)


@scenario("nav at 0.3 m/s", "teleop backs away, then ends", "no RUN forward before nav's neutral")
def overruled_source(box: BlackBox) -> None:
    with box.source("drive/nav") as nav:
        box.drive(nav, 0.3)
        with box.source() as teleop:
            box.drive(teleop, -0.2)
            nav.repeat(linear=0.3, angular=0.0)
            at_s = teleop.silence()
        time.sleep(2.0)
        forward = [command for command in box.board.since(at_s) if command.linear > 0]
        assert not forward, f"nav drives {forward[0].at_s - at_s:.2f} s later"
        nav.repeat(linear=0.0, angular=0.0)
        time.sleep(0.5)
        box.drive(nav, 0.3)


@scenario(
    "0.8 m/s, a lidar may limit the speed",
    "it caps at 0.3 m/s, then stops; forged and late limits without a cap come between",
    "0.3 m/s after the normal deceleration; no RUN until it lifts the stop itself",
    LIDAR,
)
def limits_of_a_lidar(box: BlackBox) -> None:
    with box.driving(0.8) as driver, box.source("limit/lidar") as lidar:
        lidar.repeat(linear=0.3, reason="person at 2 m")
        at_s = time.monotonic()
        time.sleep(2.0)
        fastest = max(command.linear for command in box.board.since(at_s + 1.2))
        assert 290 < fastest <= 300, f"{fastest} mm/s"
        old = lidar.put(linear=5.0)
        lidar.repeat(linear=0.0)
        time.sleep(1.0)
        at_s, echo = time.monotonic(), box.client.state["heartbeat"]
        forged: list[Map] = [
            {"linear": math.nan}, {"linear": math.inf}, {"linear": -1.0}, {"linear": "fast"},
            {"linear": 5.0, "echo": echo - 100}, {"linear": 5.0, "echo": echo + 100_000},
            {"linear": 5.0, "echo": None}, {"linear": 5.0, "seq": 1}, {"reason": "x" * 5000},
        ]  # fmt: skip
        # A stop that were lifted would let the neutral request count, and the next one move.
        for fields, speed in itertools.product(forged, (0.0, 0.4)):
            driver.repeat(linear=speed, angular=0.0)
            for _ in range(5):
                lidar.put(**fields)
                box.client.put(lidar.key, old)
                time.sleep(TICK_S)
        box.no_run(at_s)
        lidar.repeat(linear=5.0)
        driver.repeat(linear=0.0, angular=0.0)
        time.sleep(1.0)
        box.drive(driver, 0.4)


@scenario(
    "0.4 m/s, a pendant keeps its emergency stop alive",
    "it ends; its old messages and forged ones go on",
    "BRAKE latched within 1.1 s",
    PENDANT,
)
def replayed_pendant(box: BlackBox) -> None:
    with box.source("estop_keepalive/pendant") as pendant:
        pendant.repeat()
        with box.driving(0.4):
            sent = [pendant.put() for _ in range(20)]
            at_s, echo = pendant.silence(), box.client.state["heartbeat"]
            forged = [{"seq": 1}, {"echo": echo - 60}, {"echo": echo + 10_000}, {"echo": None}]
            for fields in itertools.islice(itertools.cycle(forged), 40):
                pendant.put(**fields)
                box.client.put(pendant.key, random.choice(sent))
                time.sleep(TICK_S)
            box.brakes(at_s, 1.1)
            assert box.runs(at_s + 0.5), "a forged message stops the vehicle"
            wait_until(lambda: "estop_keepalive" in box.client.latched, "latched", 1.0)


@scenario("0.4 m/s", "a wall ahead, the stick is held", "stops up to 0.6 m before it, no contact")
def wall_ahead(box: BlackBox) -> None:
    board = box.board
    with box.driving(0.4):
        board.wall_m = board.distance + 1.5
        wait_until(lambda: b"blocked" in box.client.newest[STATE], "blocked by the wall", 15.0)
        time.sleep(1.0)
        gap_m = board.wall_m - board.distance
    assert board.linear == 0.0, f"moves at {board.linear:.2f} m/s"
    assert 0.0 < gap_m <= 0.6, f"{gap_m:.2f} m left"
    assert not box.client.latched, f"latched: {box.client.latched}"


@scenario(
    "0.28 m/s, the board ignores STOP", "the stick is let go", "BRAKE v / a + 0.5 s after STOP"
)
def stop_without_effect(box: BlackBox) -> None:
    with box.driving(0.28) as driver:
        box.board.ignores_stop = True
        let_go_s = driver.silence()
        stopped_s = box.first("stop", let_go_s, 2.0)
        box.brakes(stopped_s, STOPPED_S + BRAKE_S)


@scenario("standing", "rolls at 0.1 m/s", "BRAKE within 0.05 m, `uncommanded_motion` latched")
def rolling_away(box: BlackBox) -> None:
    box.armed()
    rolls(box)
    wait_until(lambda: "uncommanded_motion" in box.client.latched, "latched", 1.0)


@scenario("standing, safety killed", "rolls at 0.1 m/s", "BRAKE of the bridge within 0.05 m")
def rolling_away_without_safety(box: BlackBox) -> None:
    box.armed()
    box.processes["services.safety"].kill()
    time.sleep(0.5)
    rolls(box)


def rolls(box: BlackBox) -> None:
    """Let the vehicle roll; require BRAKE in time."""
    at_s, from_m = time.monotonic(), box.board.distance
    assert box.board.commands[-1].kind == "stop", "it is not STOP that holds the vehicle"
    box.board.rolls = 0.1
    box.first("brake", at_s, 4.0)
    rolled_m = box.board.distance - from_m
    assert rolled_m <= ROLLED_M, f"BRAKE after {rolled_m:.3f} m"


@scenario("standing", "three restarts of the board, 0.12 s each", "its brakes are on within 0.35 s")
def restarted_brakes(box: BlackBox) -> None:
    box.armed()
    for number in range(3):
        time.sleep(1.0 + 0.13 * number)
        box.board.restart(0.12)
        time.sleep(0.12)
        on = becomes_true(lambda: all(box.board.brakes.values()), 0.35)
        assert on, f"still off: {box.board.brakes}"
