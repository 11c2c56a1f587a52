"""Ports, restarts and switches of the board: groups 7, 8 and 12."""

import time

from verification.outside.board import Faults
from verification.outside.clients import LINK, STATE
from verification.outside.stack import free_port, wait_for
from verification.outside.testbed import Result, Testbed, scenario, seconds

NO_SWITCHES = ("safety.require_switches=false", "safety.unsafe_overrides=require_switches")


@scenario(
    7,
    "velocity comes on both ports, answers on the second only",
    "arms within 5 s and drives; Link.ports names the second port",
    faults=lambda: Faults(answer_ports=(1,)),
    armed=False,
)
def second_port(bed: Testbed) -> Result:
    begin = time.monotonic()
    if not wait_for(lambda: bed.observer.last(LINK)["armed"], 5.0):
        return Result(f"never armed; waiting: {bed.observer.last(LINK)['waiting']!r}", ok=False)
    armed = time.monotonic() - begin
    bed.arm(3.0)
    with bed.source() as source:
        bed.drive(source, 0.3)
    ports = bed.observer.last(LINK).get("ports", {})
    named = bed.board.host_ports[1] in ports.values()
    text = "named" if named else f"not named in {ports}"
    return Result(f"armed {seconds(armed)}, drives; second port {text}", named)


@scenario(
    7,
    "answers on both ports; a hit at 0.4 m/s is reported on the second only",
    "BRAKE within 0.1 s, latched, no RUN later than 0.15 s",
    faults=lambda: Faults(hit_ports=(1,)),
)
def hit_on_second(bed: Testbed) -> Result:
    return hit(bed)


@scenario(
    7,
    "answers on both ports; a hit at 0.4 m/s is reported on the first only",
    "BRAKE within 0.1 s, latched, no RUN later than 0.15 s",
    faults=lambda: Faults(hit_ports=(0,)),
)
def hit_on_first(bed: Testbed) -> Result:
    return hit(bed)


def hit(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.4)
        at = time.monotonic()
        bed.board.bumper = 1
        brake = bed.first("brake", at, 2.0)
        time.sleep(1.0)
    late = bed.runs(at + 0.15)
    latched = "contact" in bed.observer.latched
    text = f"BRAKE {seconds(brake)}, {len(late)} RUN later, {'' if latched else 'not '}latched"
    return Result(text, brake is not None and brake <= 0.1 and latched and not late)


@scenario(
    8,
    "the board restarts within 120 ms with its counters at zero, five times",
    "its emergency brakes are on again within 0.35 s each",
)
def restart(bed: Testbed) -> Result:
    took: list[float | None] = []
    for number in range(5):
        time.sleep(1.0 + 0.13 * number)
        bed.board.restart(0.12)
        at = time.monotonic()
        on = wait_for(lambda: all(bed.board.brakes.values()), 5.0)
        took.append(time.monotonic() - at if on else None)
    known = [each for each in took if each is not None]
    text = f"off for {seconds(max(known, default=None))} at worst"
    return Result(text, len(known) == len(took) and max(known) <= 0.35)


@scenario(
    12,
    "the board echoes no switch; require_switches = false is accepted",
    "drives",
    sets=NO_SWITCHES,
    sets_if_known=("bridge.require_switches=false", "bridge.unsafe_overrides=require_switches"),
    faults=lambda: Faults(switch_echo=False),
    armed=False,
)
def no_switch_echo(bed: Testbed) -> Result:
    begin = time.monotonic()
    with bed.source() as source:
        wait_for(lambda: bed.observer.last(LINK)["armed"], 5.0)
        time.sleep(1.5)  # the neutral request goes on until safety has its inputs for a while
        source.request(0.3)
        driven = wait_for(lambda: bed.speed() > 0.25, 3.0)
    why = bed.observer.last(LINK)["waiting"] or bed.observer.last(STATE)["text"]
    text = "drives" if driven else f"{len(bed.runs(begin))} RUN; {why}"
    return Result(text, driven)


@scenario(
    12,
    "board.address = ::1",
    "the bridge refuses the setting: exit code 78 within 5 s, the field is named",
    armed=False,
)
def ipv6_board(bed: Testbed) -> Result:
    ports = [free_port(), free_port()]
    sets = ["board.address=::1", f"board.listen_ports={ports}"]
    code, out = bed.stack.run("services.bridge", sets=sets, timeout=5.0)
    named = "address" in out
    line = out.strip().splitlines()[-1][:120] if out.strip() else ""
    text = "runs on" if code is None else f"exit {code}: {line}"
    return Result(text, code not in (None, 0) and named)
