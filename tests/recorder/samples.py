"""Samples as received from the bus."""

from common.freshness import NS_PER_S
from t2 import codec
from t2 import messages as m
from t2.codec import Sample
from tests import factories

ROOT = "t2/v1/001"
BEGIN_NS = 1_700_000_000 * NS_PER_S  # on the wall clock
MONO_NS = 1000 * NS_PER_S


def sample(
    path: str,
    message: m.Message,
    at_s: float = 0.0,
    raw: bytes | None = None,
) -> Sample:
    """Return the sample of a message, received ``at_s`` seconds after the start."""
    payload, encoding = codec.encode(message), codec.encoding(type(message))
    return bare(path, payload, encoding, at_s, raw=raw)


def bare(
    path: str,
    payload: bytes,
    encoding: str = "",
    at_s: float = 0.0,
    *,
    raw: bytes | None = None,
    deleted: bool = False,
) -> Sample:
    """Return a sample of arbitrary bytes."""
    past_ns = round(at_s * NS_PER_S)
    return Sample(
        key=f"{ROOT}/{path}",
        payload=payload,
        encoding=encoding,
        deleted=deleted,
        raw=raw,
        received_ns=MONO_NS + past_ns,
        wall_ns=BEGIN_NS + past_ns,
    )


def velocity(linear: float = 0.5, seq: int = 1) -> m.Velocity:
    return m.Velocity(seq=seq, t_ns=BEGIN_NS - 5, linear=linear, angular=0.0)


def odometry(x: float = 1.0, heading: float = 0.0) -> m.Odometry:
    return factories.odometry(x=x, y=2.0, heading=heading)


def ultrasonic() -> m.Ultrasonic:
    ranges = (1.0, None, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
    return m.Ultrasonic(ranges=ranges, status=("ok", "no_echo", "ok", "ok", "ok", "ok", "ok", "ok"))


def state(*latched: str) -> m.SafetyState:
    return factories.safety_state(latched=latched)
