"""Parameters of the simulated vehicle: dynamics, sensors, firmware and cable.

The manual gives almost none of them. The defaults are ideal; a profile overrides some.
"""

from typing import Annotated, Literal

from msgspec import Meta

from common.settings import Section, Vehicle, Wire
from t2.messages import Command

Where = Literal["asked", "first", "second", "both"]  # of the PC's two ports
Chance = Annotated[float, Meta(ge=0.0, le=1.0)]
Rate = Annotated[float, Meta(ge=0.01, le=100.0)]
BrakeRate = Annotated[float, Meta(ge=0.1, le=1000.0)]
Deviation = Annotated[float, Meta(ge=0.0, le=0.5)]
Bias = Annotated[float, Meta(ge=-0.5, le=0.5)]
Share = Annotated[float, Meta(ge=-0.2, le=0.2)]
Delay = Annotated[float, Meta(ge=0.0, le=60.0)]


class Sonar(Section, frozen=True, kw_only=True):
    """The eight sonars. Chances are those of each reading of each sonar, 20 a second."""

    noise: Deviation = 0.005  # m, standard deviation
    cone: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.5  # rad, whole opening
    quantum: Annotated[float, Meta(ge=0.001, le=0.1)] = 0.001  # m, step of the reported ranges
    # m, the longest range that is reported; at most vehicle.sonar_max
    saturation: Annotated[float, Meta(ge=0.5, le=20.0)] = 20.0
    floor_chance: Chance = 0.0  # that the floor echoes
    floor_range: Annotated[float, Meta(ge=0.1, le=5.0)] = 1.0  # m, along the beam
    cross_talk: Chance = 0.0  # that the echo of a neighbour's pulse is taken, if it comes first
    vanish: Chance = 0.0  # that an echo is lost
    vanish_readings: Annotated[int, Meta(ge=1, le=200)] = 1  # for how many readings it stays lost


class Bumper(Section, frozen=True, kw_only=True):
    """The switch of the bumper strip."""

    # s after each press and release in which the switch opens and closes at random
    bounce: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.0


class Body(Section, frozen=True, kw_only=True):
    """The body at an obstacle."""

    rebound: Annotated[float, Meta(ge=0.0, le=0.9)] = 0.0  # share of the speed, backward


class Drive(Section, frozen=True, kw_only=True):
    """Motor dynamics: the speed loop of RUN, the ramp of STOP, and BRAKE (manual 2.2).

    The real figures are unknown. These brake harder than the 0.6 m/s^2 that safety assumes.
    """

    acceleration: Rate = 1.2  # m/s^2, either way, on RUN
    angular_acceleration: Rate = 3.0  # rad/s^2, on RUN
    coast: Rate = 0.8  # m/s^2, on STOP
    angular_coast: Rate = 2.0  # rad/s^2, on STOP
    brake: BrakeRate = 1000.0  # m/s^2, on BRAKE; 1000: at once
    angular_brake: BrakeRate = 1000.0  # rad/s^2, on BRAKE
    # The motion in a 10 ms step must be shorter than the smallest body, or it could pass a wall.
    max_linear: Annotated[float, Meta(gt=0.0, le=5.0)] = 1.5  # m/s
    max_angular: Annotated[float, Meta(gt=0.0, le=3.0)] = 1.5  # rad/s
    dead_time: Annotated[float, Meta(ge=0.0, le=0.5)] = 0.0  # s until a command has any effect
    lag: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.0  # s, time constant of RUN and STOP
    dead_zone: Annotated[float, Meta(ge=0.0, le=0.3)] = 0.0  # m/s of a side, slower stands still
    # The right wheels are faster than commanded by half of this share, the left ones slower.
    asymmetry: Bias = 0.0
    weak_wheel: Chance = 0.0  # share of its speed and force that one left wheel lacks
    # rad; the ground falls ahead. STOP ramps to a standstill and lets go of the wheels.
    slope: Share = 0.0


class Velocity(Section, frozen=True, kw_only=True):
    """Errors of the reported velocity."""

    noise: Deviation = 0.0  # m/s, standard deviation
    angular_noise: Deviation = 0.0  # rad/s
    bias: Bias = 0.0  # m/s
    angular_bias: Bias = 0.0  # rad/s


class Counters(Section, frozen=True, kw_only=True):
    """Errors of the counted distance and turn: systematic shares, and random walks."""

    scale: Share = 0.0  # share of the distance
    turn_scale: Share = 0.0  # share of the turn
    pull: Share = 0.0  # rad counted per m, on a straight line
    noise: Annotated[float, Meta(ge=0.0, le=0.2)] = 0.0  # m per sqrt(m)
    turn_noise: Annotated[float, Meta(ge=0.0, le=0.2)] = 0.0  # rad per sqrt(rad)


class Firmware(Section, frozen=True, kw_only=True):
    """Behaviour of the board that the manual leaves open."""

    answers: Where = "asked"  # where answers go: to the port that asked, by default
    hits: Where | None = None  # where reports of a pressed bumper go; None: as all answers
    confirms: bool = True  # whether it confirms its emergency brake switches
    ignores: tuple[Command, ...] = ()  # motion commands that it does not obey
    # s without a motion command until the board does STOP by itself; 0: never
    watchdog: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.0
    split: Chance = 0.0  # that a frame is sent in two datagrams
    # s that frames wait to be sent in one datagram; 0: one datagram for each
    merge: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.0


class Line(Section, frozen=True, kw_only=True):
    """Faults of one direction of the cable; chances of a datagram."""

    port: Literal["first", "second", "both"] = "both"  # of the PC's two, the one with these faults
    drop: Chance = 0.0
    duplicate: Chance = 0.0
    corrupt: Chance = 0.0  # one to three bits flipped
    delay: Delay = 0.0  # s
    jitter: Delay = 0.0  # s, maximum additional delay
    rate: Annotated[float, Meta(ge=1e3)] | None = None  # bit/s; unlimited without any


class Cable(Section, frozen=True, kw_only=True):
    """The cable between board and PC."""

    to_pc: Line = Line()
    to_board: Line = Line()


class Model(Section, frozen=True, kw_only=True):
    """One vehicle with its board and cable."""

    sonar: Sonar = Sonar()
    bumper: Bumper = Bumper()
    body: Body = Body()
    drive: Drive = Drive()
    velocity: Velocity = Velocity()
    counters: Counters = Counters()
    firmware: Firmware = Firmware()
    cable: Cable = Cable()
    wire: Wire = Wire()  # of the settings, unless the profile differs
    vehicle: Vehicle = Vehicle()  # the same
