"""LCM; ``where`` is a multicast URL."""

import lcm

from bench.path.twist import Say, packed, unpacked


def sender(where: str) -> Say:
    """Return what sends."""
    bus = lcm.LCM(where)
    return lambda *twist: bus.publish("twist", packed(*twist))


def listen(where: str, take: Say) -> None:
    """Take what comes, until killed."""

    def heard(_: str, raw: bytes) -> None:
        take(*unpacked(raw))

    bus = lcm.LCM(where)
    bus.subscribe("twist", heard)
    while True:
        bus.handle()
