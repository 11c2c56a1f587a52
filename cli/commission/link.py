"""Whether the board is heard as it should be: state, rates, ports, rejections, CRC."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from cli.commission.verdict import Verdict, judged
from common.freshness import NS_PER_S
from common.messages import Link, Switches

ENOUGH = 0.7  # of the rate that was asked: the poll slows down by half when answers are missed
VELOCITY_HZ = 10.0  # comes unasked; safety stops when it is older than 0.2 s
STRAY = 0.01  # of all frames: a damaged one now and then is the cable's, more is a cause
CRC_FRAMES = 1000  # to be heard without one bad CRC
TELLING_FRAMES = 50  # of these; a payload of zeros has CRC 0 under nearly every CRC
MOST_BAD = 0.5  # from here on it is another CRC, not a bad cable
BAD_CRC = "bad_crc"


@dataclass(frozen=True, slots=True)
class Ports:
    """Our ports, and how many datagrams came to the one that stands by."""

    numbers: tuple[int, ...]
    standby: int | None  # None: the bridge's counters were not heard twice


def asked_rates(settings: Mapping[str, float]) -> dict[str, float]:
    """Return which frames to expect, in Hz, by the bridge's settings."""
    return {
        "VelocityReport": VELOCITY_HZ,
        "BumperReport": settings["bridge.bumper_rate"],
        "DistanceReport": settings["bridge.mileage_rate"],
        "UltrasonicReport": settings["bridge.ultrasonic_rate"],
        "DriverReport": 2 * settings["bridge.driver_rate"],
    }


def judge_link(
    links: Sequence[Link], switches: Switches | None, asked: Mapping[str, float], ports: Ports
) -> Verdict:
    """Judge some seconds of the link's messages, at least one, the newest last."""
    last = links[-1]
    rates = {name: median(link.rates.get(name, 0.0) for link in links) for name in asked}
    data = [
        ("state", last.state),
        *((f"{name}, Hz", _rate(rates[name], asked[name], name)) for name in asked),
        ("switches echoed on", _switches(switches)),
        ("ports", _ports(ports)),
        ("round trip", "unknown" if last.round_trip is None else f"{last.round_trip * 1e3:.1f} ms"),
        ("rejected since the bridge's start", _listed(last.rejected)),
        ("rejected in this step", _listed(rejected(links))),
        ("waiting for", last.waiting or "nothing"),
    ]
    return judged(_link_problems(links, switches, rates, asked), "The board is heard.", data)


def judge_crc(links: Sequence[Link], frames: int, telling: int) -> Verdict:
    """Judge the CRC by some seconds of the link's messages and the frames heard in them.

    ``frames`` is how many the bridge took, ``telling`` how many of those had no payload of zeros.
    """
    bad = rejected(links).get(BAD_CRC, 0)
    data = [
        ("frames taken", str(frames)),
        ("of these with a payload that is not zeros", str(telling)),
        ("bad CRCs in this step", str(bad)),
        ("bad CRCs since the bridge's start", str(links[-1].rejected.get(BAD_CRC, 0))),
    ]
    return judged(_crc_problems(bad, frames, telling), f"{frames} frames, no bad CRC.", data)


def rejected(links: Sequence[Link]) -> dict[str, int]:
    """Return what was rejected between the first message and the last, by reason."""
    before, after = links[0].rejected, links[-1].rejected
    more = {reason: count - before.get(reason, 0) for reason, count in after.items()}
    return {reason: count for reason, count in more.items() if count}


def _link_problems(
    links: Sequence[Link],
    switches: Switches | None,
    rates: Mapping[str, float],
    asked: Mapping[str, float],
) -> Iterator[str]:
    if any(link.state != "up" for link in links):
        yield (
            f"The link is {links[-1].state} or was not up all the time: `t2 wire decode` shows "
            "what the board sends, `t2 wire identify-crc` which CRC it has."
        )
        return
    if links[0].epoch != links[-1].epoch:
        yield "The board started anew in these seconds: look at its power."
    for name, rate in rates.items():
        if rate < ENOUGH * asked[name]:
            yield f"{name} comes at {rate:.0f} Hz, expected are {asked[name]:.0f}."
    if switches is None or not (switches.ultrasonic_brake and switches.bumper_brake):
        yield "The board has not echoed that both its emergency brakes are on."
    seconds = (links[-1].mono_ns - links[0].mono_ns) / NS_PER_S
    heard = seconds * sum(sum(link.rates.values()) for link in links) / len(links)
    for reason, count in rejected(links).items():
        if reason != BAD_CRC and count > STRAY * heard:
            yield f"{count} rejected as {reason}: `t2 wire decode` shows them."


def _crc_problems(bad: int, frames: int, telling: int) -> Iterator[str]:
    if bad and bad >= MOST_BAD * (bad + frames):
        yield (
            f"{bad} bad CRCs against {frames} good frames: this firmware has another CRC. Capture "
            "what the board sends, ask `t2 wire identify-crc capture.pcap`, and set wire.crc."
        )
    elif bad:
        yield f"{bad} bad CRCs against {frames} good frames: look at the cable and its plugs."
    elif frames < CRC_FRAMES or telling < TELLING_FRAMES:
        yield (
            f"Too few frames to tell: {frames} of {CRC_FRAMES}, of these {telling} of "
            f"{TELLING_FRAMES} with a payload that is not zeros."
        )


def _rate(rate: float, asked: float, name: str) -> str:
    wanted = f"at least {asked:.0f}" if name == "VelocityReport" else f"asked {asked:.0f}"
    return f"{rate:.0f} ({wanted})"


def _switches(switches: Switches | None) -> str:
    if switches is None:
        return "not heard"
    return f"ultrasonic {switches.ultrasonic_brake}, bumper {switches.bumper_brake}"


def _ports(ports: Ports) -> str:
    numbers = " and ".join(map(str, ports.numbers))
    if len(ports.numbers) == 1:
        return f"{numbers}, the only one that is set"
    if ports.standby is None:
        return f"{numbers}; which carry something is unknown"
    return f"{numbers}; {'both carry' if ports.standby else 'only one carries'} what the board says"


def _listed(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{reason} {count}" for reason, count in sorted(counts.items())) or "nothing"
