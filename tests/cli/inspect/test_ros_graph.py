"""Diagnosis of nodes of ROS 2 from their tokens."""

from cli.inspect import remedies
from cli.inspect.diagnosis import Finding, Observation
from cli.inspect.ros_graph import diagnose_ros, place
from services.ros2 import names
from services.ros2.rihs import HASHES

ODOM, TWIST = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist"
STAMPED, TRIGGER = "geometry_msgs/msg/TwistStamped", "std_srvs/srv/Trigger"
GATEWAY = names.Node(0, "60", "/", "t2")
NAV = names.Node(0, "4a", "/", "nav")
RVIZ = names.Node(0, "4b", "/screen", "rviz")
OURS = (
    GATEWAY.token,
    GATEWAY.endpoint_token(1, "MP", "/odom", ODOM, names.QOS),
    GATEWAY.endpoint_token(2, "MP", "/tf_static", "tf2_msgs/msg/TFMessage", names.QOS_LATCHED),
    GATEWAY.endpoint_token(3, "MS", "/cmd_vel", STAMPED, names.QOS),
    GATEWAY.endpoint_token(4, "MS", "/cmd_vel", TWIST, names.QOS),
    GATEWAY.endpoint_token(5, "SS", "/hardware/e_stop_trigger", TRIGGER, names.QOS),
)
READS = NAV.endpoint_token(6, "MS", "/odom", ODOM, names.QOS)
DRIVES = NAV.endpoint_token(7, "MP", "/cmd_vel", STAMPED, names.QOS)


def diagnosed(
    *tokens: str, runs: bool = True, where: tuple[int, str] | None = (0, "/")
) -> list[Finding]:
    return list(diagnose_ros(Observation(
        zenoh="1", t2="1", instances={"ros2": 1} if runs else {},
        ros_tokens=list(tokens), ros_place=where,
    )))  # fmt: skip


def only(found: list[Finding], level: str) -> Finding:
    """Return the one finding that is not ok."""
    (finding,) = (each for each in found if each.level != "ok")
    assert finding.level == level
    assert finding.where == "ros"
    return finding


def test_without_ros_there_is_nothing_to_report() -> None:
    assert diagnosed(runs=False) == []
    assert diagnosed("a/b", runs=False) == []


def test_a_planner_that_fits() -> None:
    found = diagnosed(*OURS, NAV.token, RVIZ.token, READS, DRIVES)
    assert [(each.level, each.text) for each in found] == [
        ("ok", "nodes on domain 0: /nav, /screen/rviz"),
    ]


def test_nodes_without_the_gateway() -> None:
    finding = only(diagnosed(NAV.token, READS, runs=False), "wrong")
    assert finding.text == "the gateway is not running; nodes of ROS 2 are here: /nav"
    assert finding.todo == remedies.ROS_GATEWAY


def test_a_gateway_without_an_answer_or_with_hidden_tokens() -> None:
    assert "does not return its settings" in only(diagnosed(*OURS, where=None), "unknown").text
    assert only(diagnosed(), "unknown").todo == remedies.ROS_HIDDEN
    assert only(diagnosed(*OURS, where=(0, "/t2_001")), "unknown").todo == remedies.ROS_HIDDEN


def test_a_gateway_without_any_other_node() -> None:
    finding = only(diagnosed(*OURS), "note")
    assert finding.text == "the gateway is on domain 0, without any other node"
    assert finding.todo == remedies.ROS_NO_NODE


def test_a_second_gateway() -> None:
    found = diagnosed(*OURS, GATEWAY._replace(zid="61").token, NAV.token, READS)
    assert only(found, "wrong").todo == remedies.ROS_TWICE
    assert "2 nodes are called /t2" in only(found, "wrong").text


def test_a_node_on_another_domain() -> None:
    away = NAV._replace(domain=3)
    endpoint = away.endpoint_token(6, "MS", "/odom", TWIST, names.QOS)
    finding = only(diagnosed(*OURS, away.token, endpoint), "wrong")
    assert finding.text == "nodes on domain 3, the gateway is on 0: /nav"
    assert finding.todo == remedies.ROS_DOMAIN


def test_another_type() -> None:
    wrong = NAV.endpoint_token(7, "MP", "/cmd_vel", ODOM, names.QOS)
    finding = only(diagnosed(*OURS, NAV.token, READS, wrong), "wrong")
    assert finding.text == (
        "/nav publishes /cmd_vel as nav_msgs/msg/Odometry, the gateway has geometry_msgs/msg/Twist "
        "or geometry_msgs/msg/TwistStamped: nothing arrives"
    )
    assert finding.todo == remedies.ROS_TYPE


def test_another_hash() -> None:
    for verb, token in (
        ("/nav subscribes to /odom", READS.replace(HASHES[ODOM], "TypeHashNotSupported")),
        ("/nav publishes /cmd_vel", DRIVES.replace(HASHES[STAMPED], "TypeHashNotSupported")),
    ):
        finding = only(diagnosed(*OURS, NAV.token, READS.replace("/6/", "/9/"), token), "wrong")
        assert finding.text.startswith(f"{verb} with type hash TypeHashNotSup instead of RIHS01_")
        assert finding.text.endswith(": nothing arrives")
        assert finding.todo == remedies.ROS_HASH


def test_a_client_with_another_hash() -> None:
    client = NAV.endpoint_token(8, "SC", "/hardware/e_stop_trigger", TRIGGER, names.QOS)
    assert not [each for each in diagnosed(*OURS, NAV.token, READS, client) if each.level != "ok"]
    wrong = client.replace(HASHES[TRIGGER], "RIHS01_00")
    finding = only(diagnosed(*OURS, NAV.token, READS, wrong), "wrong")
    assert finding.text.startswith("/nav calls /hardware/e_stop_trigger with type hash RIHS01_00 ")


def test_topics_of_others_are_their_business() -> None:
    scan = NAV.endpoint_token(9, "MP", "/scan", TWIST, names.QOS)
    served = NAV.endpoint_token(10, "SS", "/odom", TRIGGER, names.QOS)
    found = diagnosed(*OURS, NAV.token, READS, scan, served)
    assert {each.level for each in found} == {"ok"}


def test_domain_and_namespace_in_the_settings_of_a_gateway() -> None:
    settings = {"ros2.domain": {"value": 7, "origin": "x"}, "ros2.namespace": {"value": "/t2"}}
    assert place(settings) == (7, "/t2")
    assert place({"ros2.domain": {"value": "7"}}) is None
    assert place(None) is None
