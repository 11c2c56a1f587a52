"""Programs that end, hang or wait: the vehicle stands, and the process exits with its own code."""

import asyncio
import subprocess
import sys
import time

import pytest

import t2
import t2.drive
from sim.requests import Bumper
from verification.harness.stack import RunningStack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

EXIT_S = 60.0  # a host under load; without the end of the main thread nothing ends the programs
OPEN = """
import asyncio, os, sys, threading, time
from concurrent.futures import ThreadPoolExecutor
import t2

def drive_on(robot):
    with robot.drive("nav") as drive:
        while True:
            drive.velocity(0.05, seconds=10)
            time.sleep(0.1)

robot = t2.connect("001", endpoint=sys.argv[1])
robot.odometry.latest(timeout=20)
robot.events.on(print)
"""
DRIVE = """
drive = robot.drive("nav")
drive.__enter__()
drive.velocity(0.05, seconds=10)
"""
THREAD = "threading.Thread(target=drive_on, args=[robot]).start()"
POOL = "pool.submit(drive_on, robot)"
WORKER = f"""
{THREAD}
while robot.safety.latest().source != "nav":
    time.sleep(0.05)
"""
PROGRAMS = {
    "it ends": ("", 0),
    "it raises": (DRIVE + "1 / 0", 1),
    "it exits": (DRIVE + "sys.exit(3)", 3),
    "a thread drives": (WORKER, 0),
    "a pool drives": ("pool = ThreadPoolExecutor()" + WORKER.replace(THREAD, POOL), 0),
    "a task drives": ("""
async def main():
    global opening
    opening = t2.aconnect("001", endpoint=sys.argv[1])
    drive = (await opening.__aenter__()).drive("nav")
    await drive.__aenter__()
    task = asyncio.create_task(drive.forward(20, speed=0.05))
    await asyncio.sleep(0.5)
asyncio.run(main())
""", 0),
    "a fork ends": (DRIVE + """
if not os.fork():
    sys.exit(5)
sys.exit(os.waitstatus_to_exitcode(os.wait()[1]))
""", 5),
    "a thread opens it later": ("""
def connect():
    threading.main_thread().join()
    try:
        t2.connect("001", endpoint=sys.argv[1])
    except t2.LinkError as error:
        print("refused:", error)
threading.Thread(target=connect).start()
""", 0),
}  # fmt: skip


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_end_of_the_main_thread_stops_and_exits(
    name: str, robot: t2.Robot, stack: RunningStack
) -> None:
    body, code = PROGRAMS[name]
    words = [sys.executable, "-c", OPEN + body, stack.endpoint]
    done = subprocess.run(words, capture_output=True, text=True, timeout=EXIT_S, check=False)
    assert done.returncode == code, done.stdout + done.stderr
    assert ("refused: the main thread has ended" in done.stdout) == ("later" in name)
    wait_until(lambda: robot.safety.latest().source is None, "no source in control")


def await_request(robot: t2.Robot, *, moves: bool) -> None:
    """Wait until the vehicle drives, or stands."""
    wait_until(lambda: (abs(robot.velocity.latest().linear) > 0.02) == moves, "the motion")


def test_a_blocked_event_loop_stops_its_motion(robot: t2.Robot, stack: RunningStack) -> None:
    async def main() -> None:
        async with (
            t2.aconnect("001", endpoint=stack.endpoint) as twin,
            twin.drive("nav") as drive,
        ):
            motion = asyncio.create_task(drive.forward(20.0, speed=0.1))
            while (await twin.velocity.latest(timeout=5.0)).linear < 0.05:
                await asyncio.sleep(0.05)
            await_request(robot, moves=False)  # blocks
            time.sleep(t2.drive.BLOCKED_S)
            with pytest.raises(t2.Late, match="event loop was blocked"):
                await motion

    asyncio.run(asyncio.wait_for(main(), EXIT_S))


def test_a_blocked_event_loop_ends_its_release(robot: t2.Robot, stack: RunningStack) -> None:
    async def main() -> None:
        async with t2.aconnect("001", endpoint=stack.endpoint) as twin:
            release = asyncio.create_task(twin.release("backward", "teleop", timeout=EXIT_S))
            while twin.safety.newest is None or twin.safety.newest.source != "teleop":
                await asyncio.sleep(0.05)
            wait_until(lambda: robot.safety.latest().source is None, "the end of the release")
            time.sleep(t2.drive.BLOCKED_S)
            with pytest.raises(t2.Late, match="event loop was blocked"):
                await release

    stack.control.do(Bumper(pressed=True))
    try:
        wait_until(lambda: robot.bumper.latest().pressed, "the contact")
        asyncio.run(asyncio.wait_for(main(), EXIT_S))
    finally:
        stack.control.do(Bumper(pressed=False))
