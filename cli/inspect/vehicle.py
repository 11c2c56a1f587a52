"""Diagnosis from the bridge to the wheels, from an observation of the bus. Pure."""

from collections.abc import Iterator

from cli.inspect import remedies
from cli.inspect.diagnosis import Finding, Level, Observation
from common import keys
from common.messages import SONAR_NAMES, Link, Message, Relay

STREAMS = (keys.VELOCITY, keys.MILEAGE, keys.BUMPER, keys.ULTRASONIC, keys.ODOMETRY)
ENOUGH = 0.5  # of a stream's rate; below that, safety stops the vehicle
SONARS = {
    "fault": ("is faulty", remedies.SONAR_FAULT),
    "too_near": ("is covered: an object is below its minimum range", remedies.SONAR_NEAR),
}


def diagnose_vehicle(seen: Observation) -> Iterator[Finding]:
    """Return all findings behind the bridge, and safety's state last."""
    if not seen.instances.get("bridge"):
        yield Finding("link", "unknown", "the board is unknown without a bridge")
    elif (now := seen.of(keys.LINK)) is None:
        yield Finding("link", "unknown", "the bridge does not report the board")
    else:
        yield from relay(now.relay, seen.t2)
        yield from link(now, seen.first[keys.LINK.path])
        if now.state == "up":
            for check in (switches, streams, sensors, drivers):
                yield from check(seen)
        else:
            yield Finding("sensors", "unknown", "no sensor data without the board")
    yield from safety(seen)


def relay(now: Relay | None, t2: str) -> Iterator[Finding]:
    """Report a configured relay; ``t2`` is the version of this laptop."""
    if now is None:
        return
    if now.state != "up":
        text = "the relay is silent" if now.state == "lost" else "no report of the relay received"
        yield Finding("relay", "wrong", text, remedies.RELAY)
    elif now.braking:
        text = f"the relay sends BRAKE: {now.braking}"
        yield Finding("relay", "wrong", text, remedies.RELAY_BRAKES.get(now.braking, ""))
    else:
        yield Finding("relay", "ok", f"the relay passes commands, up for {now.uptime:.0f} s")
    if now.version not in ("", t2):
        text = f"the relay is T2 {now.version}, this laptop {t2}"
        yield Finding("relay", "note", text, remedies.RELAY_UPDATE)


def link(now: Link, before: Message) -> Iterator[Finding]:
    """Report the link to the board, with rejected and unsent frames since ``before``."""
    if now.state == "never":
        text = f"no frame received from the board at {now.board}"
        yield Finding("link", "wrong", text, remedies.BOARD_NEVER)
        return
    if now.state == "lost":
        text = f"the board at {now.board} is silent"
        yield Finding("link", "wrong", text, remedies.BOARD_LOST)
        return
    earlier = before if isinstance(before, Link) else now
    new = {reason: n - earlier.rejected.get(reason, 0) for reason, n in now.rejected.items()}
    bad = ", ".join(f"{n} {reason}" for reason, n in new.items() if n > 0)
    if bad:
        text = f"the bridge rejects frames of the board: {bad}"
        yield Finding("link", "note", text, remedies.BOARD_REFUSED)
    unsent = now.send_errors - earlier.send_errors
    if unsent > 0:
        text = f"the system failed to send {unsent} datagrams to the board"
        yield Finding("link", "wrong", text, remedies.SEND_ERRORS)
    round_trip = "" if now.round_trip is None else f", answers in {now.round_trip * 1000:.1f} ms"
    yield Finding("link", "ok", f"the board at {now.board} is up{round_trip}")
    if not now.armed:
        yield Finding("link", "note", f"the bridge accepts no motion now: {now.waiting}")


def switches(seen: Observation) -> Iterator[Finding]:
    """Report the board's own emergency brakes."""
    echo = seen.of(keys.SWITCHES)
    positions = {
        "ultrasonic": echo and echo.ultrasonic_brake,
        "bumper": echo and echo.bumper_brake,
    }
    for name, on in positions.items():
        if not on:
            text = f"the board's {name} brake is {'off' if on is False else 'not confirmed'}"
            yield Finding("switches", "wrong", text, remedies.SWITCHES)
    if all(positions.values()):
        yield Finding("switches", "ok", "both emergency brakes of the board are on")


def streams(seen: Observation) -> Iterator[Finding]:
    """Report streams with a low rate, by what their publisher sends and what arrives here."""
    downsampled = []
    for topic in STREAMS:
        rate = seen.rates.get(topic.path, 0.0)
        enough_hz = ENOUGH * topic.rate_hz
        if rate >= enough_hz:
            continue
        sent_hz = seen.sent_hz(topic.path)
        if sent_hz < enough_hz:
            level: Level = "note" if rate else "wrong"
            text = f"{topic.path} has {rate:.0f} of {topic.rate_hz:g} Hz"
            yield Finding("sensors", level, text, remedies.SILENT)
        elif rate:
            name = topic.path.rpartition("/")[2]
            downsampled.append(f"{name} {rate:.0f} of {sent_hz:.0f} Hz")
        else:
            text = f"{topic.path} is sent with {sent_hz:.0f} Hz and does not arrive here"
            yield Finding("sensors", "wrong", text, remedies.NOT_HERE)
    if downsampled:
        text = f"of what the robot sends, this laptop receives a part: {', '.join(downsampled)}"
        yield Finding("sensors", "note", text, remedies.DOWNSAMPLED)


def sensors(seen: Observation) -> Iterator[Finding]:
    """Report the bumper, and each untrusted sonar."""
    if bumper := seen.of(keys.BUMPER):
        if bumper.pressed:
            yield Finding("bumper", "wrong", "the bumper is pressed", remedies.BUMPER)
        else:
            yield Finding("bumper", "ok", "the bumper is free")
    if ultrasonic := seen.of(keys.ULTRASONIC):
        bad = [(name, SONARS[status])
               for name, status in zip(SONAR_NAMES, ultrasonic.status, strict=True)
               if status in SONARS]  # fmt: skip
        for name, (text, todo) in bad:
            yield Finding("sonar", "wrong", f"the {name.replace('_', ' ')} sonar {text}", todo)
        if not bad:
            yield Finding("sonar", "ok", "all eight sonars measure")


def drivers(seen: Observation) -> Iterator[Finding]:
    """Report the motor drivers' faults."""
    for side in ("left", "right"):
        driver = seen.of(keys.DRIVER, side=side)
        if not driver:
            continue
        for fault in driver.faults:
            meaning = remedies.FAULTS.get(fault, "not documented in the manual")
            text = f"the {side} motor driver reports {fault}: {meaning}"
            yield Finding("drivers", "wrong", text, remedies.DRIVER)
        if not driver.faults:
            yield Finding("drivers", "ok", f"the {side} motor driver reports no fault")


def safety(seen: Observation) -> Iterator[Finding]:
    """Report the causes in safety's state, with safety's texts."""
    state = seen.of(keys.SAFETY)
    if state is None:
        yield Finding("safety", "unknown", "safety publishes no state")
        return
    for cause in state.causes:
        latched = cause.name in state.latched
        level: Level = "note" if cause.name in remedies.NORMAL else "wrong"
        if cause.name == "no_request":
            level = "ok"
        todo = remedies.CAUSES.get(cause.name, remedies.RESET if latched else "")
        text = f"{cause.text} ({cause.action}{', latched' * latched})"
        yield Finding("safety", level, text, todo)
    if not state.causes:
        yield Finding("safety", "ok", state.text)
