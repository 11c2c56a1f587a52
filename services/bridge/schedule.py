"""What the board is asked, how often, and where its answers are expected. Pure."""

from common.freshness import NS_PER_S
from common.wire import commands, reports
from common.wire.frame import Frame, Side
from services.bridge.config import Bridge as Settings
from services.bridge.config import BridgeConfig
from services.bridge.ports import Ports

ECHO_HZ = 5.0
STEADY = ("bumper", "mileage")  # polled at their rate, with or without answers
ASKED: dict[str, type[Frame]] = {
    "bumper": reports.BumperReport,
    "mileage": reports.DistanceReport,
    "ultrasonic": reports.UltrasonicReport,
}
ANSWERS = {kind.frame.ID: kind.frame for kind in reports.FROM_BOARD.values()}


def queries(settings: Settings) -> list[tuple[str, Frame, float]]:
    """Return what the board is asked, and how often: name, frame, rate in Hz."""
    return [
        ("bumper", commands.BumperQuery(), settings.bumper_rate),
        ("mileage", commands.DistanceQuery(), settings.mileage_rate),
        ("ultrasonic", commands.UltrasonicQuery(), settings.ultrasonic_rate),
        ("driver_left", commands.DriverQuery(Side.LEFT), settings.driver_rate),
        ("driver_right", commands.DriverQuery(Side.RIGHT), settings.driver_rate),
    ]


def ports_of(config: BridgeConfig, now_ns: int) -> Ports:
    """Return the ports of a bridge, with the rate at which each kind of frame is asked for."""
    bridge = config.bridge
    rates_hz: dict[type[Frame], float] = {
        reports.BumperReport: bridge.bumper_rate,
        reports.DistanceReport: bridge.mileage_rate,
        reports.UltrasonicReport: bridge.ultrasonic_rate,
        reports.DriverReport: bridge.driver_rate,
        reports.UltrasonicBrakeReport: ECHO_HZ,
        reports.BumperBrakeReport: ECHO_HZ,
    }
    count = len(config.board.listen_ports)
    return Ports(count, round(bridge.failover * NS_PER_S), rates_hz, now_ns)
