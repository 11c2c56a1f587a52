"""``python -m sim.camera``: the camera of the simulated vehicle, as a network camera.

It draws what the vehicle would see, by ray casting through the plan of the world, and serves it as
an uncompressed stream (YUV4MPEG2) on ``sim.camera_port``. `t2 camera tcp://127.0.0.1:PORT` reads it
like any other one. A process of its own: drawing must not delay the simulated board.
"""

import argparse
import math
import os
import random
import socket
import sys
import time
from collections.abc import Iterable
from contextlib import closing, suppress
from functools import cached_property
from typing import NamedTuple

import msgspec

from common import log
from common.cli_args import add_sources, run_program, sources
from common.config import load
from common.log import Logger
from sim.config import Config, load_plan
from sim.geometry import Pose, Segment, in_cone, ray
from sim.requests import GetTruth
from sim.simulation import Reply
from sim.sockets import HOST, LARGEST
from sim.trace import Truth
from sim.world import World, person_at
from t2.errors import LinkError

WIDTH, HEIGHT, RATE = 320, 180, 15
COLUMN, ROW = 2, 2  # pixels that are drawn as one
VIEW = math.radians(80.0)
FOCAL = WIDTH / 2 / math.tan(VIEW / 2)  # pixels
EYE = 0.6  # m, above the floor
TILE = 0.5  # m, of the floor's pattern
REPLY_S, SEND_S, LATE_S = 0.5, 0.5, 0.5
NICENESS = 15
LUMA = WIDTH * HEIGHT  # bytes
NOISE = int.from_bytes(b"\x03" * LUMA)  # the greatest value of each pixel
HEADER = f"YUV4MPEG2 W{WIDTH} H{HEIGHT} F{RATE}:1 Ip A1:1 C420jpeg\n".encode()


class Look(NamedTuple):
    """How a surface looks: its height in metres, luma close by, and its colour (U, V)."""

    height: float
    luma: int
    colour: tuple[int, int]


WALL, BOX = Look(2.5, 205, (124, 130)), Look(1.1, 190, (104, 150))
LOW, PERSON = Look(0.15, 200, (80, 145)), Look(1.75, 120, (136, 148))
CEILING, FLOOR = (225, 128, 128), ((120, 95), 126, 130)
Surface = tuple[Segment, Look]


class Column(NamedTuple):
    """A column of a picture: luma, U and V of each row."""

    luma: bytearray
    u: bytearray
    v: bytearray


class View:
    """Draws pictures of a world from a pose."""

    def __init__(self, world: World, ahead: float) -> None:
        """``ahead``: from the middle of the vehicle to the lens, in metres."""
        self._ahead = ahead
        self._surfaces: list[Surface] = [(wall, WALL) for wall in world.walls]
        for box in world.boxes:
            look = LOW if box.low else BOX
            self._surfaces += [(side, look) for side in box.shape.outline(box.pose)]

    @cached_property
    def _floor_rows(self) -> list[tuple[int, float]]:
        """Rows below the horizon, with the depth in metres at which they see the floor."""
        first = HEIGHT // 2
        return [(row, EYE * FOCAL / (row + ROW / 2 - first)) for row in range(first, HEIGHT, ROW)]

    def picture(self, pose: Pose, person: tuple[float, float] | None) -> bytes:
        """Return the planes of a picture: Y, U, V."""
        eye = Pose(*pose.outward(self._ahead, 0.0), pose.heading)
        surfaces = list(self._surfaces)
        if person is not None:
            box = person_at(Pose(*person, 0.0))
            surfaces += [(side, PERSON) for side in box.shape.outline(box.pose)]
        seen = in_cone(eye.x, eye.y, eye.heading, VIEW / 2, [segment for segment, _ in surfaces])
        near = [surface for surface in surfaces if surface[0] in seen]
        luma = bytearray(LUMA)
        u, v = bytearray(WIDTH * HEIGHT // 4), bytearray(WIDTH * HEIGHT // 4)
        for left in range(0, WIDTH, COLUMN):
            column = self._column(eye, left, near)
            for at in range(left, left + COLUMN):
                luma[at::WIDTH] = column.luma
            u[left // 2 :: WIDTH // 2] = column.u[::2]
            v[left // 2 :: WIDTH // 2] = column.v[::2]
        return bytes(luma + u + v)

    def _column(self, eye: Pose, left: int, near: Iterable[Surface]) -> Column:
        aside = (WIDTH / 2 - left - COLUMN / 2) / FOCAL
        angle = math.atan(aside)
        column = self._empty(eye, aside)
        hits = [
            (far * math.cos(angle), look)
            for segment, look in near
            if math.isfinite(far := ray(eye.x, eye.y, eye.heading + angle, segment))
        ]
        for depth, look in sorted(hits, key=lambda hit: -hit[0]):
            _paint(column, max(depth, 0.05), look)
        return column

    def _empty(self, eye: Pose, aside: float) -> Column:
        """Return ceiling and floor."""
        half = HEIGHT // 2
        column = Column(
            bytearray([CEILING[0]]) * half + bytearray(half),
            bytearray([CEILING[1]]) * half + bytearray([FLOOR[1]]) * half,
            bytearray([CEILING[2]]) * half + bytearray([FLOOR[2]]) * half,
        )
        east = math.cos(eye.heading) - aside * math.sin(eye.heading)
        north = math.sin(eye.heading) + aside * math.cos(eye.heading)
        bright, dark = FLOOR[0]
        for row, depth in self._floor_rows:
            tile = (eye.x + depth * east) // TILE + (eye.y + depth * north) // TILE
            shade = bright if tile % 2 else dark
            column.luma[row : row + ROW] = bytes((shade,)) * ROW
        return column


def _paint(column: Column, depth: float, look: Look) -> None:
    """Paint a surface over what is behind it."""
    top = max(0, round(HEIGHT / 2 - (look.height - EYE) * FOCAL / depth))
    bottom = min(HEIGHT, round(HEIGHT / 2 + EYE * FOCAL / depth))
    if bottom <= top:
        return
    count = bottom - top
    luma = round(look.luma / (1 + 0.1 * depth))
    column.luma[top:bottom] = bytes((luma,)) * count
    column.u[top:bottom] = bytes((look.colour[0],)) * count
    column.v[top:bottom] = bytes((look.colour[1],)) * count


def noisy(picture: bytes) -> bytes:
    """Return the picture with noise, as a sensor has it: no two pictures are equal."""
    noise = int.from_bytes(random.randbytes(LUMA)) & NOISE
    luma = int.from_bytes(picture[:LUMA]) + noise  # the brightest surface leaves room for it
    return luma.to_bytes(LUMA) + picture[LUMA:]


def truth(port: int) -> Truth:
    """Return the true state from the simulator; raise ``OSError`` when it does not answer."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.settimeout(REPLY_S)
        sock.connect((HOST, port))
        sock.send(msgspec.json.encode(GetTruth()))
        found = msgspec.json.decode(sock.recv(LARGEST), type=Reply).truth
    if found is None:
        raise ConnectionError("the simulator did not return its state")
    return found


def stream(client: socket.socket, view: View, port: int) -> None:
    """Send pictures at the constant rate; raise ``OSError`` when a reader is too slow or gone.

    A reader takes the time of a picture from its number: no picture is left out.
    """
    client.settimeout(SEND_S)
    client.sendall(HEADER)
    due = time.monotonic()
    while True:
        it = truth(port)
        picture = view.picture(Pose(it.x, it.y, it.heading), it.person)
        client.sendall(b"FRAME\n" + noisy(picture))
        due += 1 / RATE
        left = due - time.monotonic()
        if left < -LATE_S:
            raise TimeoutError("drawing is too slow for the rate")
        time.sleep(max(0.0, left))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Serve one reader at a time, until SIGINT or SIGTERM; raise ``LinkError`` at the start."""
    config = load(Config, sources(options)).config
    view = View(World.of(load_plan(config.sim.world, config.vehicle)), config.vehicle.length / 2)
    os.nice(NICENESS)
    log.configure(config.log, "sim.camera")
    try:
        server = socket.create_server((HOST, config.sim.camera_port))
    except OSError as error:
        raise LinkError(
            f"sim.camera_port = {config.sim.camera_port}: cannot listen: {error.strerror}"
        ) from None
    with closing(server):
        Logger().info("started", port=server.getsockname()[1])
        with suppress(KeyboardInterrupt):
            while True:
                client, _ = server.accept()
                with closing(client), suppress(OSError):
                    stream(client, view, config.sim.control_port)
    return 0


if __name__ == "__main__":
    sys.exit(run_program("sim.camera", add_arguments, run, None, __doc__))
