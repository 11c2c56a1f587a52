"""Settings of the bridge."""

from typing import Annotated, ClassVar

from msgspec import Meta

from common import settings

Rate = Annotated[float, Meta(ge=0.2, le=200.0)]  # Hz
Positive = Annotated[float, Meta(gt=0.0, le=10.0)]


class Bridge(settings.ProtectedSection, frozen=True, kw_only=True):
    """Parameters of the bridge."""

    protective: ClassVar[settings.Limits] = {
        "lease": (0.0, 0.5),
        "silence": (0.0, 0.5),
        "coast": (0.0, 3.0),
        "deceleration": (0.1, 10.0),
        "angular_deceleration": (0.1, 10.0),
        "heartbeat": (0.0, 0.2),
        "max_linear": (0.0, 1.5),
        "max_angular": (0.0, 2.0),
        "require_switches": (True, True),
        # Lower rates delay the detection of a short hit, a near wall and a restarted board.
        "bumper_rate": (20.0, 200.0),
        "ultrasonic_rate": (10.0, 200.0),
        "mileage_rate": (10.0, 200.0),
    }
    lease: Annotated[float, Meta(ge=0.05, le=10.0)] = 0.2  # s that a motion message is valid
    silence: Annotated[float, Meta(ge=0.05, le=10.0)] = 0.2  # s without a frame: link lost
    failover: Annotated[float, Meta(ge=0.02, le=0.4)] = 0.1  # s until the other port takes over
    # s without a heartbeat of the bridge until the guard brakes
    heartbeat: Annotated[float, Meta(ge=0.05, le=10.0)] = 0.2
    coast: Annotated[float, Meta(ge=0.1, le=10.0)] = 1.0  # s of STOP at most until BRAKE
    deceleration: Positive = 0.6  # m/s^2 that a STOP must reach, or it becomes BRAKE sooner
    angular_deceleration: Positive = 1.0  # rad/s^2, likewise
    max_linear: Annotated[float, Meta(ge=0.05, le=3.0)] = 1.0  # m/s
    max_angular: Annotated[float, Meta(ge=0.05, le=3.0)] = 1.0  # rad/s
    answer_timeout: Annotated[float, Meta(ge=0.02, le=1.0)] = 0.1  # s for a query's answer
    echo_timeout: Annotated[float, Meta(ge=0.05, le=2.0)] = 0.5  # s for a switch or lamp's echo
    require_switches: bool = True  # the board must echo that its emergency brakes are on
    bumper_rate: Rate = 50.0  # Hz, of the queries
    ultrasonic_rate: Rate = 20.0  # Hz
    mileage_rate: Rate = 25.0  # Hz
    driver_rate: Rate = 2.0  # Hz, for each side

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.failover >= self.silence:
            raise ValueError(f"failover {self.failover} s must be under silence {self.silence} s")


class BridgeConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that the bridge reads."""

    board: settings.Board = settings.Board()
    wire: settings.Wire = settings.Wire()
    vehicle: settings.Vehicle = settings.Vehicle()
    bridge: Bridge = Bridge()

    def __post_init__(self) -> None:
        known = settings.Wire()
        crc = self.wire.crc, self.wire.crc_covers
        if self.board.relay_port and crc != (known.crc, known.crc_covers):
            raise ValueError(
                f"board.relay_port wants wire.crc {known.crc} over the {known.crc_covers}: "
                "the relay knows no other"
            )
