"""Settings of the simulated vehicle."""

from typing import Annotated, Literal

from msgspec import Meta

from common.settings import Board, Section, Shared, Vehicle, Wire

Rate = Annotated[float, Meta(ge=0.01, le=100.0)]


class Drive(Section, frozen=True, kw_only=True):
    """How the motors follow: the speed loop of RUN, and the ramp of STOP (manual 2.2).

    The real figures are unknown. These brake harder than the 0.6 m/s^2 that safety counts on.
    """

    acceleration: Rate = 1.2  # m/s^2, either way, on RUN
    angular_acceleration: Rate = 3.0  # rad/s^2, on RUN
    coast: Rate = 0.8  # m/s^2, on STOP
    angular_coast: Rate = 2.0  # rad/s^2, on STOP
    # A step of 10 ms must stay shorter than the smallest body, or it could jump a wall.
    max_linear: Annotated[float, Meta(gt=0.0, le=5.0)] = 1.5  # m/s
    max_angular: Annotated[float, Meta(gt=0.0, le=3.0)] = 1.5  # rad/s


class Sim(Section, frozen=True, kw_only=True):
    """The simulated vehicle and its world."""

    world: str = "office"  # a name in sim/worlds, or the path of a TOML file
    seed: Annotated[int, Meta(ge=0)] = 1  # of the sonar's noise and of the faults on the wire
    control_port: Annotated[int, Meta(ge=0, le=65535)] = 0  # UDP on 127.0.0.1; 0: none
    drive: Drive = Drive()
    sonar_noise: Annotated[float, Meta(ge=0.0, le=0.5)] = 0.005  # m, standard deviation
    sonar_cone: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.5  # rad, whole opening
    # How the board's own emergency brakes work is unknown. Its sonar brake acts nearer than
    # safety's margin of 0.20 m: it is the line behind, not the one in front.
    brake_range: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.15  # m
    bumper_brake: Literal["toward", "all"] = "toward"  # what it refuses while pressed
    led_channels: Annotated[int, Meta(ge=0, le=256)] = 16  # the board refuses others


class Config(Shared, frozen=True, kw_only=True):
    """All that the simulated vehicle reads."""

    board: Board = Board()
    wire: Wire = Wire()
    vehicle: Vehicle = Vehicle()
    sim: Sim = Sim()
