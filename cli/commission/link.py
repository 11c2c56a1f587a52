"""Verdicts on the board's link: state, rates, ports, rejected frames, CRC. Pure."""

from collections.abc import Iterator, Mapping, Sequence
from statistics import mean, median

from cli.commission.report import Verdict, judged
from cli.commission.texts import ENGLISH, Say
from common.freshness import NS_PER_S
from t2 import keys
from t2.messages import Link, Relay, Switches

ENOUGH = 0.7  # of the requested rate: answers may be missing
VELOCITY_HZ = 10.0  # sent unrequested; safety stops when it is older than 0.2 s
ENOUGH_FRAMES = 700  # in a step of 10 s: 70 % of a good board's
STRAY = 0.01  # of all frames: a rare damaged frame is noise on the cable
MOST_BAD = 0.5  # from this share on it is another CRC, not a bad cable
BAD_CRC = "bad_crc"
EXPECTED_HZ = {
    "VelocityReport": VELOCITY_HZ,
    "BumperReport": keys.BUMPER.rate_hz,
    "DistanceReport": keys.MILEAGE.rate_hz,
    "UltrasonicReport": keys.ULTRASONIC.rate_hz,
    "DriverReport": 2 * keys.DRIVER.rate_hz,
}


def judge_link(links: Sequence[Link], switches: Switches | None, say: Say = ENGLISH) -> Verdict:
    """Return the verdict on consecutive link messages, at least one."""
    rates = {name: median(link.rates.get(name, 0.0) for link in links) for name in EXPECTED_HZ}
    seconds = (links[-1].mono_ns - links[0].mono_ns) / NS_PER_S
    frames = round(seconds * mean(sum(link.rates.values()) for link in links))
    data = [
        *(
            (f"{name}, Hz", say("rate_of", rate=rate, expected=EXPECTED_HZ[name]))
            for name, rate in rates.items()
        ),
        ("switches confirmed on", _switches(switches, say)),
        ("received at port", _listed(links[-1].ports) or say("nothing")),
        ("relay", _relay(links[-1].relay, say)),
        ("rejected", _listed(rejected(links)) or say("nothing")),
    ]
    problems = [
        *_link_problems(links, switches, rates, say),
        *_rejections(rejected(links), frames, say),
    ]
    return judged(problems, say("link.good", frames=frames), data, say)


def rejected(links: Sequence[Link]) -> dict[str, int]:
    """Return the frames rejected between the first and the last message, by reason."""
    before, after = links[0].rejected, links[-1].rejected
    new = {reason: count - before.get(reason, 0) for reason, count in after.items()}
    return {reason: count for reason, count in new.items() if count}


def _link_problems(
    links: Sequence[Link], switches: Switches | None, rates: Mapping[str, float], say: Say
) -> Iterator[str]:
    if any(link.state != "up" for link in links):
        yield say("link.down", state=links[-1].state)
        return
    if any(link.relay and (link.relay.state != "up" or link.relay.braking) for link in links):
        yield say("link.relay", relay=_relay(links[-1].relay, say))
    if links[0].epoch != links[-1].epoch:
        yield say("link.restarted")
    for name, rate in rates.items():
        if rate < ENOUGH * EXPECTED_HZ[name]:
            yield say("link.rate", name=name, rate=rate, expected=EXPECTED_HZ[name])
    if switches is None or not (switches.ultrasonic_brake and switches.bumper_brake):
        yield say("link.brakes")


def _rejections(counts: Mapping[str, int], frames: int, say: Say) -> Iterator[str]:
    """Yield the problems of rejected frames; ``frames`` were accepted."""
    if frames < ENOUGH_FRAMES:
        yield say("link.few", frames=frames)
    bad = counts.get(BAD_CRC, 0)
    if bad and bad >= MOST_BAD * (bad + frames):
        yield say("link.crc", bad=bad, frames=frames)
    elif bad:
        yield say("link.cable", bad=bad, frames=frames)
    for reason, count in counts.items():
        if reason != BAD_CRC and count > STRAY * frames:
            yield say("link.rejected", count=count, reason=reason)


def _switches(switches: Switches | None, say: Say) -> str:
    if switches is None:
        return say("not_received")
    names = {True: "on", False: "off", None: "unknown"}
    ultrasonic, bumper = names[switches.ultrasonic_brake], names[switches.bumper_brake]
    return say("switches", ultrasonic=ultrasonic, bumper=bumper)


def _relay(relay: Relay | None, say: Say) -> str:
    if relay is None:
        return say("relay.none")
    if relay.state != "up":
        return say("relay.silent")
    name = "relay.braking" if relay.braking else "relay.passing"
    return say(name, version=relay.version, braking=relay.braking)


def _listed(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{reason} {count}" for reason, count in sorted(counts.items()))
