"""The simulated vehicle: body, world, sensors, board and cable, in steps of simulated time.

Time is an input: ``advance`` steps up to it, ``receive`` and ``handle`` happen at it. Outputs are
collected: datagrams for the PC, and lines for the trace. The same seed and the same calls give the
same outputs. One step::

    command -> velocity -> motion in the world -> sensors -> stream -> trace
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import singledispatchmethod

import msgspec
from msgspec import Struct

from common.freshness import NS_PER_S
from common.motion import STILL, Twist
from common.wire import framing
from common.wire import reports as r
from common.wire.commands import TO_BOARD, MotionCommand, MotionKind
from common.wire.frame import Side
from common.wire.framing import Received
from sim import requests as q
from sim import trace as t
from sim.board import STOP, Board, Switch
from sim.faults import Cable, Datagram
from sim.firmware import Output
from sim.geometry import Pose, Rectangle
from sim.model import Model
from sim.requests import Asked
from sim.sonar import Sonars
from sim.vehicle import Motors, move, moved, rebounded
from sim.world import Plan, World, person_at
from t2.messages import Command

STEP_NS = NS_PER_S // 100
STREAM_STEPS = 2  # velocity at 50 Hz
SONAR_STEPS = 5  # one round of echoes: 20 Hz
TRUTH_STEPS = 5  # 20 Hz
PERSON_STEPS = 5  # 20 Hz
PERSON_GAP = 0.1  # m, that a person keeps from the vehicle
CATCH_UP_NS = NS_PER_S // 2  # a longer gap is skipped: the world is paused meanwhile

COMMANDS = {
    MotionKind.STOP: Command.STOP,
    MotionKind.RUN: Command.RUN,
    MotionKind.BREAK: Command.BRAKE,
}


class Reply(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The answer to a request; ``error`` is the reason of a refusal."""

    ok: bool
    error: str = ""
    truth: t.Truth | None = None


class Simulation:
    """A vehicle that was powered on at ``now_ns``; its start must be free of obstacles."""

    def __init__(
        self,
        model: Model,
        plan: Plan,
        now_ns: int,
        seed: int = 1,
        ports: Sequence[int] = (4002, 4001),  # of the PC
    ) -> None:
        self.now_ns = now_ns  # end of the last step
        self.world = World.of(plan)
        self.body = Rectangle(model.vehicle.length / 2, model.vehicle.width / 2)
        self.pose = plan.start.pose
        self.twist = STILL
        self._pressed_by_hand = False
        self._sonars = Sonars(model.vehicle, model.sonar, seed)
        self._ranges = self._sonars.measure(self.world, self.pose)
        self.board = Board(model, self._ranges, seed)
        self.to_pc = Cable(seed + 1, model.cable.to_pc, ports)
        self.to_board = Cable(seed + 2, model.cable.to_board, ports)
        self.counters: Counter[str] = Counter()
        self._ports = ports
        self._output = Output(model.firmware, ports, seed)
        self._motors = Motors(model.drive, model.vehicle.track)
        self._rebound = model.body.rebound
        self._switch = Switch(model.bumper.bounce, seed)
        self._records: list[t.Line] = []
        self._steps = 0
        self._driven = 0.0
        self._contact = self.world.contact(self.body, self.pose)
        self._room = self.world  # without a person
        self._person: q.Person | None = None  # where it is now
        self._person_until_ns = now_ns
        self._silent_until_ns = now_ns
        self._powered = True
        self._flood, self._flood_until_ns = q.Flood(), now_ns
        self._reported_pressed = False
        self._command = t.Command(mono_ns=now_ns, kind=Command.STOP, linear=0.0, angular=0.0)

    def advance(self, now_ns: int) -> None:
        """Step up to now; skip a gap that is too long."""
        gap_ns = now_ns - self.now_ns - CATCH_UP_NS
        if gap_ns > 0:
            self.now_ns += gap_ns
            self.counters["holes"] += 1
        while self.now_ns + STEP_NS <= now_ns:
            self.now_ns += STEP_NS
            self._step()
            self._receive(self.now_ns)

    def receive(self, payload: bytes, port: int, now_ns: int) -> None:
        """Process a datagram from this port of the PC."""
        self.to_board.put(Datagram(payload, port), now_ns)
        self._receive(now_ns)

    def take_sent(self, now_ns: int) -> list[Datagram]:
        """Return the datagrams that leave for the PC by now."""
        sent = self.to_pc.take(now_ns)
        for datagram in sent:
            self._record_bumper(datagram, now_ns)
        return sent

    def take_records(self) -> Sequence[t.Line]:
        """Return the trace lines since the last call."""
        records, self._records = self._records, []
        return records

    def handle(self, request: Asked, now_ns: int) -> Reply:
        """Apply one request; a refused one changes nothing."""
        if isinstance(request, q.GetTruth):
            return Reply(ok=True, truth=self.truth(now_ns))
        error = self._apply(request, now_ns) or ""
        self._records.append(t.Disturbed(mono_ns=now_ns, request=request, error=error))
        return Reply(ok=not error, error=error)

    @singledispatchmethod
    def _apply(self, request: Asked, now_ns: int) -> str | None:
        """Apply a request; return the reason of a refusal, if any."""
        raise NotImplementedError

    @_apply.register
    def _(self, request: q.Bumper, now_ns: int) -> None:
        self._pressed_by_hand = request.pressed
        self._update_bumper(now_ns)

    @_apply.register
    def _(self, request: q.Sonar, _: int) -> None:
        self._sonars.inject(request)

    @_apply.register
    def _(self, request: q.Driver, now_ns: int) -> None:
        side = Side[request.side.upper()]
        changed = request.bits != self.board.driver_bits[side]
        self.board.driver_bits[side] = request.bits
        if changed and request.bits:
            self._send(self._output.unasked(self.board.driver(side)), now_ns)

    @_apply.register
    def _(self, request: q.Freeze | q.PowerCycle, now_ns: int) -> None:
        self._silent_until_ns = now_ns + round(request.seconds * NS_PER_S)
        if isinstance(request, q.PowerCycle):
            self._powered = False
            self.twist = STILL  # unpowered wheels hold: their motors are geared and shorted
            self.board.power_on()
            self._hold(self.board.command, now_ns)
            self._records.append(t.Power(mono_ns=now_ns, on=False))

    @_apply.register
    def _(self, request: q.Mute, _: int) -> None:
        self._output.mute([q.REPORTS[name] for name in request.reports], request.every)

    @_apply.register
    def _(self, request: q.Firmware, _: int) -> None:
        self._output.firmware = request

    @_apply.register
    def _(self, request: q.Flood, now_ns: int) -> None:
        self._flood = request
        self._flood_until_ns = now_ns + round(request.seconds * NS_PER_S)

    @_apply.register
    def _(self, request: q.Wire, _: int) -> None:
        if request.direction != "to_board":
            self.to_pc.faults = request
        if request.direction != "to_pc":
            self.to_board.faults = request

    @_apply.register
    def _(self, request: q.Place, now_ns: int) -> str | None:
        pose = Pose(request.x, request.y, request.heading)
        if self.world.blocks(self.body, pose):
            return f"an obstacle is at x {request.x:g}, y {request.y:g}"
        self.pose, self.twist = pose, STILL
        self._update_bumper(now_ns)
        return None

    @_apply.register
    def _(self, request: q.Person, now_ns: int) -> str | None:
        if not self._let_stand(request):
            return f"the vehicle is at x {request.x:g}, y {request.y:g}"
        self._person_until_ns = now_ns + round(request.seconds * NS_PER_S)
        return None

    def _let_stand(self, person: q.Person) -> bool:
        """Put the person where it wants to be; return whether the vehicle is not there."""
        box = person_at(Pose(person.x, person.y, person.heading))
        if World(walls=(), boxes=(box,)).clearance(self.body, self.pose) < PERSON_GAP:
            return False
        self._person = person
        self.world = replace(self._room, boxes=(*self._room.boxes, box))
        return True

    def truth(self, now_ns: int) -> t.Truth:
        """Return the true state."""
        clearance = self.world.clearance(self.body, self.pose)
        return t.Truth(
            mono_ns=now_ns,
            x=self.pose.x,
            y=self.pose.y,
            heading=self.pose.heading,
            linear=self.twist.linear,
            angular=self.twist.angular,
            distance=self._driven,
            clearance=clearance if math.isfinite(clearance) else None,
            contact=self._contact,
            pressed=self._switch.closed,
            command=self._command,
            person=(self._person.x, self._person.y) if self._person else None,
        )

    def _update_bumper(self, now_ns: int) -> None:
        """Update the bumper after a change of pose or hand."""
        self._contact = self.world.contact(self.body, self.pose)
        self._sense(now_ns)

    def _step(self) -> None:
        self._steps += 1
        self._update_power()
        self._update_watchdog()
        if self._person is not None and self._steps % PERSON_STEPS == 0:
            self._walk(self._person)
        self._move(STEP_NS / NS_PER_S)
        if self._steps % SONAR_STEPS == 0:
            self._ranges = self._sonars.measure(self.world, self.pose)
        self._sense(self.now_ns)
        if self._steps % STREAM_STEPS == 0:
            self._send(self._output.unasked(self.board.velocity()), self.now_ns)
        if self.now_ns < self._flood_until_ns:
            self._send_flood()
        if self._is_merged():
            self._send(self._output.merged(), self.now_ns)
        if self._steps % TRUTH_STEPS == 0:
            self._records.append(self.truth(self.now_ns))

    def _walk(self, person: q.Person) -> None:
        """Let the person walk on, wait before the vehicle, or be gone."""
        if self.now_ns >= self._person_until_ns:
            self._person, self.world = None, self._room
        elif person.speed:
            here = Pose(person.x, person.y, person.heading)
            there = moved(here, Twist(person.speed, 0.0), PERSON_STEPS * STEP_NS / NS_PER_S)
            self._let_stand(msgspec.structs.replace(person, x=there.x, y=there.y))
        self._contact = self.world.contact(self.body, self.pose)

    def _update_power(self) -> None:
        if not self._powered and not self._silent(self.now_ns):
            self._powered = True
            self._records.append(t.Power(mono_ns=self.now_ns, on=True))

    def _is_merged(self) -> bool:
        wait_ns = self._output.firmware.merge * NS_PER_S
        return wait_ns > 0 and self._steps % max(1, round(wait_ns / STEP_NS)) == 0

    def _update_watchdog(self) -> None:
        silence_s = (self.now_ns - self._command.mono_ns) / NS_PER_S
        if 0 < self._output.firmware.watchdog < silence_s:
            self.board.command = STOP

    def _move(self, dt: float) -> None:
        command = self.board.drive()
        twist = self._motors.follow(self.twist, command.kind, self.board.target(command), dt)
        if twist == STILL:
            self.twist = twist
            return
        way = move(self.pose, twist, dt, lambda pose: self.world.blocks(self.body, pose))
        self.pose, self.twist = way.pose, rebounded(twist, self._rebound) if way.held else twist
        self._driven += abs(way.distance)
        self.board.count(way.distance, way.turn)
        self._contact = self.world.contact(self.body, self.pose)

    def _receive(self, now_ns: int) -> None:
        for datagram in self.to_board.take(now_ns):
            if self._silent(now_ns):
                self.counters["unheard"] += 1
            else:
                self._read(datagram, now_ns)

    def _read(self, datagram: Datagram, now_ns: int) -> None:
        for part in framing.read(datagram.payload, TO_BOARD):
            if not isinstance(part, Received):
                self.counters[f"rejected_{part.reason}"] += 1
                continue
            self.counters[type(part.frame).__name__] += 1
            if isinstance(part.frame, MotionCommand):
                self._hold(part.frame, now_ns)
                self._records.append(self._command)
                if self._command.kind in self._output.firmware.ignores:
                    continue
            answer = self.board.answer(part.frame)
            if answer is not None:
                self._send(self._output.answer(answer, datagram.port), now_ns)

    def _hold(self, command: MotionCommand, now_ns: int) -> None:
        target = self.board.target(command)
        self._command = t.Command(
            mono_ns=now_ns,
            kind=COMMANDS[command.kind],
            linear=target.linear,
            angular=target.angular,
        )

    def _send_flood(self) -> None:
        payload = self._flood.datagram or framing.pack(self.board.velocity())
        for number in range(self._flood.rate * STEP_NS // NS_PER_S):
            port = self._ports[number % len(self._ports)]
            self._send([Datagram(payload, port)], self.now_ns)

    def _send(self, datagrams: Sequence[Datagram], now_ns: int) -> None:
        if not self._silent(now_ns):
            for datagram in datagrams:
                self.to_pc.put(datagram, now_ns)

    def _record_bumper(self, datagram: Datagram, now_ns: int) -> None:
        if r.BumperReport.OPENING not in datagram.payload:
            return
        for part in framing.read(datagram.payload, r.FROM_BOARD):
            if not isinstance(part, Received) or not isinstance(part.frame, r.BumperReport):
                continue
            if part.frame.on != self._reported_pressed:
                self._reported_pressed = part.frame.on
                self._records.append(t.BumperSent(mono_ns=now_ns, pressed=self._reported_pressed))

    def _sense(self, now_ns: int) -> None:
        self._switch.touch(self._contact or self._pressed_by_hand, now_ns)
        self.board.sense(self.twist, self._ranges, self._switch.closed)

    def _silent(self, now_ns: int) -> bool:
        return now_ns < self._silent_until_ns
