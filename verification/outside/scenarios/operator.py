"""Operator calls that are late, forged or unknown: groups 2 and 15."""

import time

import zenoh

from verification.outside.clients import ROOT, STATE, Map
from verification.outside.testbed import Result, Testbed, scenario

REPLY = "application/msgpack;t2.v1.Done"


@scenario(
    2,
    "a reset held for 5 s by a proxy arrives after a newer contact; then 0.3 m/s is requested",
    "refused, the contact stays latched, no RUN",
)
def late_reset(bed: Testbed) -> Result:
    bed.contact()
    bed.board.bumper = 0
    time.sleep(0.3)
    held = bed.operator.reset_request()
    begin = time.monotonic()
    if not bed.operator.reset():
        return Result("the first contact cannot be reset", ok=False)
    time.sleep(3.0)
    bed.contact(seconds=0.1)
    bed.board.bumper = 0
    time.sleep(max(0.5, begin + 5.0 - time.monotonic()))
    at = time.monotonic()
    done, text = bed.operator.call("safety/reset", held)
    with bed.source() as source:
        source.request(0.3)
        time.sleep(1.5)
    runs = bed.runs(at)
    ok = not done and not runs and "contact" in bed.observer.latched
    return Result(f"{'obeyed' if done else 'refused'} ({text}); {len(runs)} RUN", ok)


@scenario(
    2,
    "20 calls of a held release are delivered 2 s late, nobody holds any more",
    "no RUN",
)
def late_release(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.3)
        bed.contact()
        source.silence()
    time.sleep(0.5)
    held = []
    for _ in range(20):
        held.append(bed.operator.release_request("backward"))
        time.sleep(0.1)
    time.sleep(1.0)
    at = time.monotonic()
    for request in held:
        bed.operator.call("safety/release", request, 0.3)
        time.sleep(0.1)
    runs = bed.runs(at)
    return Result(f"{len(runs)} RUN", not runs)


@scenario(
    15,
    "a rogue queryable on srv/safety/reset answers 'ok'; `t2 call safety/reset`",
    "the contact stays latched and `t2 call` reports that nothing is confirmed",
)
def rogue_reset(bed: Testbed) -> Result:
    bed.contact(seconds=0.1)

    def answer(query: "zenoh.Query") -> None:
        query.reply(query.key_expr, b"\x81\xa4text\xa2ok", encoding=REPLY)

    rogue = bed.bus.declare_queryable(f"{ROOT}/srv/safety/reset", answer, complete=True)
    time.sleep(0.5)
    try:
        code, out = bed.stack.run("cli", "call", "safety/reset")
    finally:
        rogue.undeclare()
    latched = "contact" in bed.observer.latched
    text = out.strip().splitlines()[-1] if out.strip() else "nothing"
    return Result(f"exit {code}, {text!r}", latched and code != 0 and "ok" not in text.lower())


@scenario(
    15,
    "5000 names request motion under @cmd/drive/",
    "safety's health message stays under 16 kB",
)
def many_sources(bed: Testbed) -> Result:
    for number in range(5000):
        bed.bus.put(f"{ROOT}/@cmd/drive/x{number}", b"\x80")
        if number % 50 == 0:
            time.sleep(0.02)
    time.sleep(2.5)
    sizes = [size for _, _, size in bed.observer.messages["tel/safety/health"]]
    at = time.monotonic()
    alive = bool(bed.observer.since(STATE, at - 0.5))
    text = f"{max(sizes, default=0) / 1000:.1f} kB" + ("" if alive else ", no state")
    return Result(text, alive and 0 < max(sizes, default=0) < 16_000)


@scenario(
    2,
    "reset, release, odom/reset and switches without an echo, and with one that safety never sent",
    "all eight refused with a reason; nothing cleared, moved or switched",
)
def unknown_echo(bed: Testbed) -> Result:
    at = bed.contact(seconds=0.3)
    bed.board.bumper = 0
    time.sleep(0.3)
    state = bed.observer.last(STATE)
    ids = [cause.get("id", 0) for cause in state["causes"] if cause["name"] in state["latched"]]
    requests: dict[str, Map] = {
        "safety/reset": {"causes": ids},
        "safety/release": {"held": True, "direction": "backward"},
        "odom/reset": {"x": 1.0},
        "bridge/switches": {"bumper_brake": False},
    }
    obeyed = []
    for name, request in requests.items():
        for echo in ({}, {"echo": state["heartbeat"] + 1_000_000}):
            done, text = bed.operator.call(name, request | echo, 1.0)
            if done or not text or text == "no answer":
                obeyed.append(f"{name} {'with' if echo else 'without'} echo")
        if name == "safety/reset" and "contact" not in bed.observer.latched:
            bed.contact(seconds=0.3)
            bed.board.bumper = 0
    time.sleep(0.5)
    runs = bed.runs(at)
    text = f"obeyed: {', '.join(obeyed) or 'none'}; {len(runs)} RUN"
    brakes = all(bed.board.brakes.values())
    ok = not obeyed and not runs and brakes and "contact" in bed.observer.latched
    return Result(text + ("" if brakes else "; a brake switch is off"), ok)


@scenario(
    2,
    "a fresh reset that names no cause, and one that names the causes of an earlier contact",
    "both clear nothing",
)
def other_causes(bed: Testbed) -> Result:
    bed.contact(seconds=0.1)
    bed.board.bumper = 0
    time.sleep(0.3)
    old = bed.operator.reset_request().get("causes", [])
    if not bed.operator.reset():
        return Result("the first contact cannot be reset", ok=False)
    bed.contact(seconds=0.3)
    bed.board.bumper = 0
    time.sleep(0.5)
    cleared = []
    for name, causes in (("none", []), ("earlier", old)):
        request = bed.operator.reset_request() | {"causes": causes}
        bed.operator.call("safety/reset", request)
        time.sleep(0.3)
        if "contact" not in bed.observer.latched:
            cleared.append(name)
            bed.contact(seconds=0.3)
            bed.board.bumper = 0
            time.sleep(0.5)
    good = bed.operator.reset()
    text = f"cleared by naming: {', '.join(cleared) or 'nothing'}"
    return Result(text + ("" if good else "; the right reset fails, too"), not cleared and good)
