"""From what was seen to findings, on the way from the bridge to the wheels. Pure."""

from collections.abc import Iterator

from cli.inspect import remedies
from cli.inspect.diagnosis import Finding, Level, Seen
from common.keys import BUMPER, MILEAGE, ODOMETRY, ULTRASONIC, VELOCITY
from common.messages import SONAR_NAMES, Driver, Link

STREAMS = (VELOCITY, MILEAGE, BUMPER, ULTRASONIC, ODOMETRY)
ENOUGH = 0.5  # of a stream's rate; safety stops at less than that by itself


def at_the_vehicle(seen: Seen) -> Iterator[Finding]:
    """Return all findings behind the bridge, safety's own words last."""
    if not seen.instances.get("bridge"):
        yield Finding("link", "unknown", "without a bridge nothing is known of the board")
    elif seen.link is None:
        yield Finding("link", "unknown", "the bridge tells nothing of the board")
    else:
        yield from link(seen.link, seen.first_link)
        if seen.link.state == "up":
            yield from switches(seen)
            yield from sensors(seen)
            yield from drivers(seen.drivers)
        else:
            yield Finding("sensors", "unknown", "not to be read without the board")
    yield from driving(seen)
    yield from safety(seen)


def link(now: Link, before: Link | None) -> Iterator[Finding]:
    """Tell of the way to the board."""
    if now.state == "never":
        text = f"the board at {now.board} has never been heard"
        yield Finding("link", "wrong", text, remedies.BOARD_NEVER)
        return
    if now.state == "lost":
        text = f"the board at {now.board} is silent"
        yield Finding("link", "wrong", text, remedies.BOARD_LOST)
        return
    earlier = before.rejected if before else {}
    fresh = {why: n - earlier.get(why, 0) for why, n in now.rejected.items()}
    bad = ", ".join(f"{n} {why}" for why, n in fresh.items() if n > 0)
    if bad:
        text = f"the bridge refuses what the board sends: {bad}"
        yield Finding("link", "note", text, remedies.BOARD_REFUSED)
    refused = now.send_errors - (before.send_errors if before else 0)
    if refused > 0:
        text = f"the system refused to send {refused} datagrams to the board"
        yield Finding("link", "wrong", text, remedies.SEND_ERRORS)
    trip = "" if now.round_trip is None else f", answers in {now.round_trip * 1000:.1f} ms"
    yield Finding("link", "ok", f"the board at {now.board} is there{trip}")
    if not now.armed:
        yield Finding("link", "note", f"the bridge would obey no motion now: {now.waiting}")


def switches(seen: Seen) -> Iterator[Finding]:
    """Tell of the board's own emergency brakes."""
    told = seen.switches
    positions = {
        "ultrasonic": told and told.ultrasonic_brake,
        "bumper": told and told.bumper_brake,
    }
    for name, on in positions.items():
        if not on:
            text = f"the board's {name} brake is {'off' if on is False else 'not confirmed'}"
            yield Finding("switches", "wrong", text, remedies.SWITCHES)
    if all(positions.values()):
        yield Finding("switches", "ok", "both emergency brakes of the board are on")


def sensors(seen: Seen) -> Iterator[Finding]:
    """Tell of streams that are missing or thin, of the bumper, and of each sonar."""
    for topic in STREAMS:
        rate = seen.rates.get(topic.path, 0.0)
        if rate >= ENOUGH * topic.rate_hz:
            continue
        level: Level = "note" if rate else "wrong"
        text = f"{topic.path} comes at {rate:.0f} of {topic.rate_hz:g} Hz"
        yield Finding("sensors", level, text, remedies.SILENT)
    if seen.bumper and seen.bumper.pressed:
        yield Finding("bumper", "wrong", "the bumper is pressed", remedies.BUMPER)
    elif seen.bumper:
        yield Finding("bumper", "ok", "the bumper is free")
    if seen.ultrasonic:
        yield from sonars(seen.ultrasonic.status)


def sonars(statuses: tuple[str, ...]) -> Iterator[Finding]:
    """Tell of each sonar that cannot be trusted."""
    by_status = {
        "fault": ("is faulty", remedies.SONAR_FAULT),
        "too_near": ("sees something too near to measure", remedies.SONAR_NEAR),
    }
    bad = [(n, status) for n, status in zip(SONAR_NAMES, statuses, strict=True)
           if status in by_status]  # fmt: skip
    for name, status in bad:
        text, todo = by_status[status]
        yield Finding("sonar", "wrong", f"the {name.replace('_', ' ')} sonar {text}", todo)
    if not bad:
        yield Finding("sonar", "ok", "all eight sonars measure")


def drivers(told: dict[str, Driver]) -> Iterator[Finding]:
    """Tell of the motor drivers' faults."""
    for side, driver in sorted(told.items()):
        for fault in driver.faults:
            meaning = remedies.FAULTS.get(fault, "a bit that the manual does not explain")
            text = f"the {side} driver reports {fault}: {meaning}"
            yield Finding("drivers", "wrong", text, remedies.DRIVER)
        if not driver.faults:
            yield Finding("drivers", "ok", f"the {side} driver reports no fault")


def driving(seen: Seen) -> Iterator[Finding]:
    """Tell who asks to move, and of those who are one too many."""
    if len(seen.deciding) > 1:
        yield Finding("driving", "wrong", "two programs publish @cmd/motion", remedies.TWICE)
    for source, boots in sorted(seen.asking.items()):
        if len(boots) > 1:
            text = f"{len(boots)} programs drive as {source}"
            yield Finding("driving", "wrong", text, remedies.ONE_DRIVER)
    if len(seen.asking) > 1:
        names = ", ".join(sorted(seen.asking))
        text = f"{names} ask to move at once; the one with the highest priority drives"
        yield Finding("driving", "note", text)
    elif not any(len(boots) > 1 for boots in seen.asking.values()):
        who = next(iter(seen.asking), "nobody")
        yield Finding("driving", "ok", f"{who} asks to move")


def safety(seen: Seen) -> Iterator[Finding]:
    """Tell what safety holds against moving, with its own words."""
    state = seen.safety
    if state is None:
        yield Finding("safety", "unknown", "safety tells nothing")
        return
    for cause in state.causes:
        latched = cause.name in state.latched
        level: Level = "note" if cause.name in remedies.NORMAL else "wrong"
        if cause.name == "no_request":
            level = "ok"
        todo = remedies.CAUSES.get(cause.name, remedies.RESET if latched else "")
        yield Finding(
            "safety", level, f"{cause.text} ({cause.action}{', latched' * latched})", todo
        )
    if not state.causes:
        yield Finding("safety", "ok", state.text)
