"""The course of an unkind vehicle: free way, emergency stop, wall, and an obstacle without echo.

Availability is judged on the free way, safety on the frames that the board received.
"""

import time
from dataclasses import dataclass

from verification.outside.clients import ROOT, STATE
from verification.outside.stack import wait_for
from verification.outside.testbed import Result, Testbed, seconds

COURSE = (
    "85 % of the requested speed, no stop without need; BRAKE within 0.1 s of an e-stop and of a "
    "contact, no RUN forward later; stops before a wall"
)
FREE_S = 5.0
UNDER_WAY_S = 0.15  # a RUN that was sent before the stop may arrive later
WALL_M, LOW_M = 1.5, 0.6
FAR_M = 0.6  # a stop farther from the wall is a stop without need


@dataclass
class Findings:
    """What was measured, and what of it is not as expected."""

    texts: list[str]
    wrong: list[str]

    def add(self, text: str, good: bool) -> None:
        self.texts.append(text)
        self.wrong += [] if good else [text]

    def result(self) -> Result:
        bad = f" | WRONG: {'; '.join(self.wrong)}" if self.wrong else ""
        return Result("; ".join(self.texts) + bad, not self.wrong)


def course(bed: Testbed, speed: float = 0.4, share: float = 0.85) -> Findings:
    """Drive the course; the mean speed on the free way must be this share of the request."""
    found = Findings([], [])
    free_way(bed, found, speed, share)
    wall(bed, found, speed)
    low_obstacle(bed, found)
    return found


def free_way(bed: Testbed, found: Findings, speed: float, share: float) -> None:
    """Drive where nothing is ahead, and press the emergency stop at speed."""
    vehicle = bed.board.vehicle
    with bed.source() as source:
        source.request(speed)
        if not wait_for(lambda: vehicle.linear > speed / 2, 4.0):
            found.add(f"does not start: {text(bed)}", good=False)
            return
        time.sleep(1.0)
        at, before = time.monotonic(), vehicle.distance
        time.sleep(FREE_S)
        mean = (vehicle.distance - before) / (time.monotonic() - at)
        held = [c for c in bed.board.since(at) if not c.moves]
        causes = bed.observer.causes(at) - {"no_request"}
        why = f" ({', '.join(sorted(causes))})" if causes else ""
        found.add(f"{mean:.2f} of {speed} m/s{why}", mean >= share * speed)
        found.add(f"{len(held)} frames without motion", not held)
        at = time.monotonic()
        bed.bus.put(f"{ROOT}/estop", b"")
        brake = bed.first("brake", at, 2.0)
        time.sleep(1.0)
        late = bed.runs(at + UNDER_WAY_S)
        good = brake is not None and brake <= 0.1 and not late
        found.add(f"e-stop: BRAKE {seconds(brake)}, {len(late)} RUN later", good)
    stands(bed)
    if not bed.operator.reset():
        found.add(f"no reset: {text(bed)}", good=False)


def wall(bed: Testbed, found: Findings, speed: float) -> None:
    """Drive at a wall that the sonars detect."""
    vehicle, board = bed.board.vehicle, bed.board
    bed.arm(5.0)
    with bed.source() as source:
        board.wall = vehicle.distance + WALL_M
        source.request(speed)
        wait_for(lambda: vehicle.linear > 0.1, 4.0)
        end, still = time.monotonic() + 15.0, 0
        while time.monotonic() < end and still < 50 and not board.contacts:
            time.sleep(0.02)
            still = still + 1 if abs(vehicle.linear) < 0.01 else 0
        gap = board.wall - vehicle.distance
    found.add(f"wall: {len(board.contacts)} contacts, {gap:.2f} m left",
              not board.contacts and 0.0 < gap <= FAR_M)  # fmt: skip
    stands(bed)
    board.wall = None
    board.contacts.clear()
    if bed.observer.latched:
        found.add(f"latched at the wall: {', '.join(bed.observer.latched)}", good=False)
        bed.operator.reset()


def low_obstacle(bed: Testbed, found: Findings) -> None:
    """Drive against an obstacle that no sonar detects, and go on requesting."""
    vehicle, board = bed.board.vehicle, bed.board
    bed.arm(5.0)
    with bed.source() as source:
        board.wall_echoes, board.wall = False, vehicle.distance + LOW_M
        source.request(0.3)
        if not wait_for(lambda: board.contacts, 12.0):
            found.add(f"no contact: {text(bed)}", good=False)
            return
        at = board.contacts[0]
        brake = bed.first("brake", at, 2.0)
        time.sleep(1.5)
        late = bed.runs(at + UNDER_WAY_S, 1)
        latched = "contact" in bed.observer.latched
    good = brake is not None and brake <= 0.1 and not late and latched
    named = "" if latched else ", not latched"
    found.add(f"contact: BRAKE {seconds(brake)}, {len(late)} RUN forward later{named}", good)


def stands(bed: Testbed) -> None:
    vehicle = bed.board.vehicle
    wait_for(lambda: abs(vehicle.linear) < 0.01 and abs(vehicle.angular) < 0.02, 4.0)
    time.sleep(0.3)


def text(bed: Testbed) -> str:
    """Return why safety lets nothing move."""
    return str(bed.observer.last(STATE).get("text", "no state of safety"))
