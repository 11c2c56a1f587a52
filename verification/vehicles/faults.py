"""Faults of a draw, each at its time; ``fault.*`` in ``ranges.toml`` has their durations."""

from collections.abc import Callable

from common.freshness import NS_PER_S
from sim import requests as q
from verification.invariants.net import MS, Disturbance
from verification.vehicles.chain import VehicleChain
from verification.vehicles.draw import Draw

Step = Callable[[VehicleChain], None]


def _mute(*reports: q.ReportName) -> Step:
    return lambda chain: chain.vehicle.inject(q.Mute(reports=reports))


def _bumper(pressed: bool) -> Step:
    return lambda chain: chain.vehicle.inject(q.Bumper(pressed=pressed))


def _driver(bits: int) -> Step:
    return lambda chain: chain.vehicle.inject(q.Driver(side="left", bits=bits))


def _silence(chain: VehicleChain) -> None:
    chain.operator.muted_until_ns = chain.net.now_ns + NS_PER_S


def _late(chain: VehicleChain) -> None:
    chain.net.disturbances["drive"] = Disturbance(late_ms=400, lose=3)


def _restart(chain: VehicleChain) -> None:
    chain.vehicle.power_cycle(800)
    chain.oracle.on_power_cycle()


def _returned(chain: VehicleChain) -> None:
    chain.oracle.comeback_ns = chain.net.now_ns


def _stall_bridge(chain: VehicleChain) -> None:
    chain.stall("bridge", 150)
    chain.oracle.slack_ns = max(chain.oracle.slack_ns, 150 * MS)


# Steps of each fault: seconds after its begin, and what happens.
FAULTS: dict[str, tuple[tuple[float, Step], ...]] = {
    "bridge_killed": ((0.0, lambda chain: chain.kill("bridge", 200)),),
    "safety_killed": ((0.0, lambda chain: chain.kill("safety", 200)),),
    "bridge_stalled": ((0.0, _stall_bridge),),
    "safety_stalled": ((0.0, lambda chain: chain.stall("safety", 400)),),
    "router_down": (
        (0.0, lambda chain: chain.router(False)),
        (1.0, lambda chain: chain.router(True)),
    ),
    "operator_silent": ((0.0, _silence),),
    "requests_late": (
        (0.0, _late),
        (0.5, lambda chain: chain.net.disturbances.clear()),
    ),
    "estop": ((0.0, lambda chain: chain.press_estop()),),
    "board_frozen": ((0.0, lambda chain: chain.vehicle.freeze(600)),),
    "board_restarted": ((0.0, _restart), (0.8, _returned)),
    "bumper_pressed": ((0.0, _bumper(True)), (0.1, _bumper(False))),
    "bumper_muted": ((0.0, _mute("bumper")), (0.5, _mute())),
    "velocity_muted": ((0.0, _mute("velocity")), (0.5, _mute())),
    "ultrasonic_muted": ((0.0, _mute("ultrasonic")), (0.8, _mute())),
    "driver": ((0.0, _driver(1)), (0.5, _driver(0))),
    "sonar_faulty": ((0.0, lambda chain: chain.vehicle.inject(q.Sonar(name="front", fault=True))),),
    "sonar_stuck": ((0.0, lambda chain: chain.vehicle.inject(q.Sonar(name="front", stuck=True))),),
}


class FaultSchedule:
    """The steps that are due, in their order."""

    def __init__(self, draw: Draw, start_ns: int) -> None:
        steps = [
            (start_ns + round((float(value) + after_s) * NS_PER_S), number, step)
            for name, value in draw.values.items()
            if name.startswith("fault.")
            for number, (after_s, step) in enumerate(FAULTS[name.removeprefix("fault.")])
        ]
        self._steps = sorted(steps, key=lambda step: step[:2], reverse=True)

    def turn(self, chain: VehicleChain) -> None:
        """Do what is due."""
        while self._steps and self._steps[-1][0] <= chain.net.now_ns:
            self._steps.pop()[2](chain)
