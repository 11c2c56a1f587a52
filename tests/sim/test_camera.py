"""The simulated camera: what it draws, and its stream as a reader of FFmpeg gets it."""

import io
import socket
import threading
from collections.abc import Iterator
from contextlib import suppress

import av
import msgspec
import pytest

from common.settings import Vehicle
from sim.camera import HEADER, HEIGHT, WIDTH, View, noisy, stream
from sim.config import load_plan
from sim.geometry import Pose
from sim.simulation import Reply
from sim.sockets import HOST
from sim.world import World
from tests.sim.sim_fixture import SimFixture

ROOM = View(World.of(load_plan("office", Vehicle())), 0.5)
MIDDLE = WIDTH // 2


def column(pose: Pose, x: int = MIDDLE, person: tuple[float, float] | None = None) -> bytes:
    """Return the luma of a column, from the top."""
    return ROOM.picture(pose, person)[: WIDTH * HEIGHT][x::WIDTH]


def height_of_wall(pose: Pose) -> int:
    """Return how many rows of the middle column have its most frequent luma: the wall's."""
    return max(column(pose).count(luma) for luma in set(column(pose)))


def test_a_picture_has_three_planes() -> None:
    assert len(ROOM.picture(Pose(0.0, 0.0, 0.0), None)) == WIDTH * HEIGHT * 3 // 2


def test_no_two_pictures_are_equal_and_noise_is_small() -> None:
    plain = ROOM.picture(Pose(0.0, 0.0, 0.0), None)
    one, other = noisy(plain), noisy(plain)
    assert one != other
    assert {now - before for now, before in zip(one, plain, strict=True)} == {0, 1, 2, 3}
    assert one[WIDTH * HEIGHT :] == plain[WIDTH * HEIGHT :]


def test_a_wall_grows_as_the_vehicle_approaches_it() -> None:
    heights = [height_of_wall(Pose(x, 0.0, 0.0)) for x in (-0.5, 0.5, 1.5)]
    assert heights == sorted(heights)
    assert heights[0] < heights[-1]


def test_the_picture_changes_with_each_motion_over_the_floor() -> None:
    for before, after in (((0.0, 0.0), (0.05, 0.0)), ((0.0, 0.0), (0.0, 0.02))):
        one, other = (ROOM.picture(Pose(x, 0.0, heading), None) for x, heading in (before, after))
        assert one != other


def test_a_person_on_the_left_is_on_the_left_of_the_picture() -> None:
    here = Pose(0.0, 0.0, 0.0)
    with_person = [
        sum(map(int.__ne__, column(here, x, (2.0, 0.7)), column(here, x)))
        for x in (WIDTH // 4, 3 * WIDTH // 4)
    ]
    assert with_person[0] > 50  # the person stands on the left: many rows differ
    assert with_person[1] == 0


@pytest.fixture
def control() -> Iterator[int]:
    """A control socket that answers with the truth of a simulated vehicle."""
    reply = msgspec.json.encode(Reply(ok=True, truth=SimFixture().truth))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind((HOST, 0))
        sock.settimeout(0.2)
        ended = threading.Event()

        def serve() -> None:
            while not ended.is_set():
                with suppress(TimeoutError):
                    sock.sendto(reply, sock.recvfrom(4096)[1])

        thread = threading.Thread(target=serve)
        thread.start()
        yield sock.getsockname()[1]
        ended.set()
        thread.join()


def test_a_reader_decodes_the_stream(control: int) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        errors: list[OSError] = []

        def serve() -> None:
            try:
                stream(theirs, ROOM, control)
            except OSError as error:
                errors.append(error)

        thread = threading.Thread(target=serve)
        thread.start()
        wanted = len(HEADER) + 3 * (6 + WIDTH * HEIGHT * 3 // 2)
        received = b""
        while len(received) < wanted:
            received += ours.recv(wanted - len(received))
        ours.close()  # the reader is gone: the stream ends
        thread.join()
    assert len(errors) == 1
    with av.open(io.BytesIO(received), "r", format="yuv4mpegpipe") as container:
        frames = list(container.decode(video=0))
    assert [(one.width, one.height, one.pts) for one in frames] == [
        (WIDTH, HEIGHT, number) for number in range(3)
    ]


def test_without_the_simulator_the_stream_ends() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs, pytest.raises(OSError, match=r"refused|timed out"):
        stream(theirs, ROOM, 1)
