"""Checks with killed processes of the robot; each returns its observation."""

from collections.abc import Callable, Sequence

from verification.harness.ports import accepts_connections
from verification.harness.waiting import wait_until
from verification.ros2.driving import driver, moves, plain_peer, reset_if_latched
from verification.ros2.fixture import GATEWAY, PATIENCE_S, Robot
from verification.ros2.plain_peer import PlainPeer, Twist


def gateway_killed(robot: Robot) -> str:
    """Kill the gateway while ROS drives; restart it and drive again."""
    with plain_peer(robot.stack.endpoint) as peer, driver(peer) as driving:
        moves(robot, driving)
        observed = robot.stops_within_lease(robot.stack.kill(GATEWAY))
        assert robot.ended() == [GATEWAY], robot.ended()
        assert not robot.latched(), robot.state
        wait_until(lambda: not _ours(peer), "no token of a killed gateway")
        wait_until(robot.is_ready, "safety ready without the gateway")
        robot.stack.start(GATEWAY)
        wait_until(lambda: _ours(peer), "tokens of the restarted gateway")
        moves(robot, driving)
    robot.wait_standstill()
    return f"{observed}; no latch; the restarted gateway is in the graph and drives"


def _ours(peer: PlainPeer) -> list[str]:
    return [token for token in peer.tokens() if "/%/%/t2" in token]


def safety_killed(robot: Robot) -> str:
    """Call the emergency stop while safety is dead; the reply reports that nothing confirms it."""
    with plain_peer(robot.stack.endpoint) as peer, driver(peer) as driving:
        moves(robot, driving)
        robot.stops_within_lease(robot.stack.kill("safety"))
        driving.twist = Twist()
        success, message = peer.call("/hardware/e_stop_trigger")
        assert not success, message
        robot.stack.start("safety")
        reset_if_latched(robot, peer)
        moves(robot, driving)
    robot.wait_standstill()
    return f"stops; the reply is success=false, {message!r}; drives after the restart"


def router_killed(robot: Robot) -> str:
    """Kill the router while ROS drives; restart it and drive again."""
    with plain_peer(robot.stack.endpoint) as peer, driver(peer) as driving:
        moves(robot, driving)
        observed = robot.stops_within_lease(robot.stack.kill("router"))
        robot.stack.start("router")
    wait_until(lambda: accepts_connections(robot.port), "the router listens", PATIENCE_S)
    with plain_peer(robot.stack.endpoint) as peer, driver(peer) as driving:
        wait_until(lambda: _ours(peer), "tokens of the gateway", PATIENCE_S)
        reset_if_latched(robot, peer)
        moves(robot, driving)
    robot.wait_standstill()
    return f"{observed}; the gateway connects again and drives"


CHECKS: Sequence[Callable[[Robot], str]] = gateway_killed, safety_killed, router_killed
