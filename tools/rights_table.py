"""The table of permissions in ``docs/security.md``: roles, classes of keys, verbs."""

from collections.abc import Mapping

import zenoh

from cli.keys import access
from cli.keys.access import Rights, Verb
from cli.keys.member_list import BOUND
from cli.keys.members import OPERATORS_SOURCES, Profile, Role
from services.ros2 import names
from services.ros2.config import Ros2
from t2 import keys

MINE, OTHER = "001", "002"  # a driver's robot, and another robot


def _laptop(role: Role, name: str, *sources: str) -> Rights:
    robots = (MINE,) if role in BOUND else ()
    return access.laptop(Profile(role=role, name=name, robots=robots, sources=sources))


ROLES: Mapping[str, Rights] = {
    "viewer": _laptop("viewer", "hall"),
    "driver of 001": _laptop("driver", "anna", *OPERATORS_SOURCES),
    "driver of 001 as nav": _laptop("driver", "nav", "nav"),
    "device lidar of 001": _laptop("device", "lidar", "lidar"),
    "fleet": _laptop("fleet", "room"),
    "site's router": access.site(),
    "router of 001": access.robot(MINE),
    "ros of 001": access.ros(Ros2()),
}
LATCHED = names.data_key(0, "/tf_static", "tf2_msgs/msg/TFMessage")
TWIST, TRIGGER = "geometry_msgs/msg/Twist", "std_srvs/srv/Trigger"
PLANNER = names.Node(0, "9a", "/", "nav")
DASHBOARD = keys.EVENTS.on(MINE, service="dashboard")
# One key of each class, with its name in the table.
CLASSES: Mapping[str, str] = {
    "measured, decided, health": keys.VELOCITY.on(MINE),
    "events": keys.EVENTS.on(MINE, service="safety"),
    "events that an operator's dashboard keeps": f"{DASHBOARD}/@adv/pub/1/uhlc/_",
    "any longer key below these": f"{DASHBOARD}/@adv/pub/1/uhlc/_/a/a/a",
    "requests to move": keys.DRIVE.on(MINE, source="teleop"),
    "requests to move as a planner": keys.DRIVE.on(MINE, source="nav"),
    "requests to move another robot": keys.DRIVE.on(OTHER, source="teleop"),
    "speed limits, and signs of life of an emergency stop": keys.LIMIT.on(MINE, source="lidar"),
    "speed limits as a source that is not hers": keys.LIMIT.on(MINE, source="person"),
    "speed limits of another robot": keys.LIMIT.on(OTHER, source="lidar"),
    "signs of life of an operator's emergency stop": keys.LIMIT.on(MINE, source="teleop"),
    "fixes of the position": keys.FIX.on(MINE, source="lidar"),
    "fixes as a source that is not hers": keys.FIX.on(MINE, source="amcl"),
    "what safety lets through": keys.MOTION.on(MINE),
    "emergency stop": keys.estop_key(MINE),
    "emergency stop of another robot": keys.estop_key(OTHER),
    "emergency stop of all": keys.estop_key("*"),
    "reset": keys.RESET.on(MINE),
    "the board's emergency brakes": keys.SET_SWITCHES.on(MINE),
    "saying where the vehicle is in the map": keys.PLACE.on(MINE),
    "starting and ending a round": keys.ROUND.on(MINE),
    "teaching and changing a route": keys.TEACH.on(MINE),
    "reading the routes": keys.ROUTES.on(MINE),
    "reading the rounds of another robot": keys.ROUNDS.on(OTHER),
    "reading the shift log": keys.LOG.on(MINE),
    "reset of another robot": keys.RESET.on(OTHER),
    "state and settings that a service returns to a query": keys.info_key(MINE, "safety", "config"),
    "presence of the services on board": keys.live_key(MINE, "safety", "1"),
    "health of an operator's dashboard": keys.HEALTH.on(MINE, service="dashboard"),
    "presence of an operator's dashboard": keys.live_key(MINE, "dashboard", "1"),
    "health of an operator's teleop": keys.HEALTH.on(MINE, service="teleop"),
    "own keys of the viewer hall": keys.app_key(MINE, "hall"),
    "own keys of the driver anna": f"{keys.app_key(MINE, 'anna')}/route/2/state",
    "the same, with more than six chunks": f"{keys.app_key(MINE, 'anna')}/1/2/3/4/5/6/7",
    "the same, at another robot": f"{keys.app_key(OTHER, 'anna')}/route",
    "own keys of the driver nav": f"{keys.app_key(MINE, 'nav')}/route",
    "any other key of the robot": f"{keys.ROOT}/{MINE}/anything",
    "keys outside of T2": "anything",
    "ROS 2: topics of the domain": names.data_key(0, "/odom", "nav_msgs/msg/Odometry"),
    "ROS 2: latched messages": f"{LATCHED}/@adv/pub/1/2/_",
    "ROS 2: `cmd_vel`, TwistStamped": names.data_key(0, "/cmd_vel", f"{TWIST}Stamped"),
    "ROS 2: `cmd_vel`, Twist": names.data_key(0, "/cmd_vel", TWIST),
    "ROS 2: `cmd_vel` of another namespace": names.data_key(0, "/t2_002/cmd_vel", TWIST),
    "ROS 2: emergency stop": names.data_key(0, "/hardware/e_stop_trigger", TRIGGER),
    "ROS 2: reset": names.data_key(0, "/hardware/e_stop_reset", TRIGGER),
    "ROS 2: nodes of the domain": PLANNER.token,
    "ROS 2: their publishers": PLANNER.endpoint_token(4, "MP", "/cmd_vel", TWIST, names.QOS),
    "ROS 2: topics of another domain": names.data_key(1, "/cmd_vel", TWIST),
    "ROS 2: nodes of another domain": PLANNER._replace(domain=1).token,
}
WORDS: Mapping[Verb, str] = {
    "read": "read", "write": "**write**", "ask": "ask", "serve": "answer", "live": "be there",
}  # fmt: skip


def may(given: Rights, verb: Verb, key: str) -> bool:
    """Return whether permissions include a verb on a key, or on every key of an expression."""
    wanted = zenoh.KeyExpr(key)
    return any(zenoh.KeyExpr(each).includes(wanted) for each in given.get(verb, ()))


def table() -> str:
    """Return the table."""
    lines = [
        f"| | key | {' | '.join(ROLES)} |",
        f"| --- | --- |{' --- |' * len(ROLES)}",
    ]
    for words, key in CLASSES.items():
        cells = (
            ", ".join(WORDS[verb] for verb in WORDS if may(given, verb, key)) or "-"
            for given in ROLES.values()
        )
        lines.append(f"| {words} | `{key}` | {' | '.join(cells)} |")
    return "\n".join(lines)
