"""MCP server: an agent reads a robot, and drives it as the source of the lowest priority.

python mcp_server.py [tcp/127.0.0.1:7447], with ``agent`` in the settings of safety:
safety.sources.agent = { priority = 1, lease = 0.3, operator = false }
Safety judges its requests like all others. The agent may stop the robot; a person resets it.
"""

import asyncio
import math
import sys
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from mcp.server import MCPServer
from mcp.server.mcpserver.exceptions import ToolError

import t2
from t2.messages import SONAR_NAMES, Event

robots: list[t2.AsyncRobot] = []
events: deque[Event] = deque(maxlen=100)
one_at_a_time = asyncio.Lock()


@asynccontextmanager
async def connected(_: MCPServer[Any]) -> AsyncIterator[None]:
    """Keep one connection while the server runs."""
    async with t2.aconnect("001", endpoint="".join(sys.argv[1:])) as robot:
        robots.append(robot)
        robot.events.on(events.append)
        yield


server = MCPServer("T2", lifespan=connected, instructions="Distances in m, angles in degrees.")


@server.tool()
async def state() -> dict[str, Any]:
    """Return what safety allows and why, and the pose."""
    safety, pose = await robots[0].safety.latest(), await robots[0].odometry.latest()
    where = {"x": pose.x, "y": pose.y, "heading": math.degrees(pose.heading)}
    return where | {"verdict": safety.verdict, "text": safety.text}


@server.tool()
async def sonars() -> dict[str, float | str]:
    """Return the nearest obstacle by direction: m, "no_echo", or why it is unknown."""
    sample = await robots[0].ultrasonic.latest()
    measured = zip(SONAR_NAMES, sample.ranges, sample.status, strict=True)
    return {name: r if s == "ok" and r is not None else s for name, r, s in measured}


@server.tool()
async def incidents() -> list[str]:
    """Return the last warnings and errors since this server started."""
    return [f"{each.name}: {each.text}" for each in [*events] if each.level != "info"]


@server.tool()
async def drive(distance: float = 0.0, turn: float = 0.0) -> dict[str, Any]:
    """Turn on the spot (positive is left), then drive straight (negative is backward)."""
    try:
        async with one_at_a_time, robots[0].drive("agent") as vehicle:
            await vehicle.turn(math.radians(turn))
            await vehicle.forward(distance)
    except t2.T2Error as error:
        raise ToolError(str(error)) from None
    return await state()


@server.tool()
async def stop() -> str:
    """Stop the robot in an emergency; only a person can reset it."""
    await robots[0].estop()
    return "stopped and latched"


if __name__ == "__main__":
    server.run()
