"""Remedies for the problems that `t2 doctor` finds, as instructions to the operator. Pure."""

REFUSED = (
    "on the robot: is `t2 up` running? By default the router listens on its own host only; "
    "docs/security.md explains how to open it for laptops"
)
NO_ROUTE = "join the robot's Wi-Fi; then --set bus.connect=tcp/ROBOT:7447 with the robot's address"
NO_NAME = "use a numeric address, or correct bus.connect"
NO_SOCKET = "the router creates this file: start it, or correct bus.connect"
KEYS = "`t2 keys list` shows the validity of certificates; renew it and copy its folder here again"
NOT_A_ROUTER = "it hangs, requires TLS, or is not a router: restart it, or correct bus.connect"
NO_ROBOT = "is it switched on, and its stack started? Otherwise correct --robot or robot.id"
START = "on the robot: `t2 up`, or start this service; if its process exists, it hangs: kill it"
HANGS = "kill its process; its supervisor restarts it"
TWICE = "stop one of them: a robot has one of each; look for a second `t2 up`"
UPDATE = "install the same version on both, and restart the robot's services"
RIGHTS = (
    "the router passes only a part of what this laptop's certificate sends; the emergency stop may "
    "be allowed. `t2 keys list` shows its role"
)
BLIND = "the router's access rules do not allow this laptop to read: use another certificate"
CLOCK = "synchronize both clocks with chrony or NTP; driving does not need it, recordings do"
SLOW_LINK = "move closer to the access point; safety refuses requests with too high a delay"
STALLS = "find the processes that use its CPU"
UNDECODABLE = "a publisher with another version, or a foreign program"

BOARD_NEVER = (
    "is the board on, its cable connected, and this robot's address the one that it sends to "
    "(board.listen_address; 10.7.5.220 on the vehicle)?"
)
BOARD_LOST = "check the board's power and cable; the link recovers by itself"
BOARD_REFUSED = "`t2 wire decode` shows the invalid frames; see wire.crc"
SEND_ERRORS = "check the robot's network interface, its firewall and board.address"
RELAY = (
    "is the relay on, its service running, and its cable to the PC connected? board.address and "
    "board.relay_port must be the relay's (docs/relay.md); without a relay set relay_port = 0"
)
RELAY_BRAKES = {
    "start": "it waits for a neutral command: is the bridge running?",
    "silent": "it lost the commands of the PC: check the cable and the load of both computers",
    "hit": "it waits for the bridge's answer to a bumper hit: is the bridge running?",
}
RELAY_UPDATE = "copy services/relay of this version to the relay (docs/relay.md)"
SWITCHES = """t2 call bridge/switches '{"ultrasonic_brake": true, "bumper_brake": true}'"""
BUMPER = "free it; if that is impossible: `t2 drive`, hold F or B, away from it; then reset"
SONAR_FAULT = "check its cable; the vehicle does not move into its sector until it measures"
SONAR_NEAR = "remove the object that covers it"
DRIVER = "switch the vehicle off and on; check what the fault names; then reset"
SILENT = "the board does not send it: check the board; `t2 hz` shows the rate"
DOWNSAMPLED = (
    "expected over TLS: the robot's router downsamples streams for laptops (bus.laptop_rate); "
    "otherwise the network is too slow. The services on board receive all of it"
)
NOT_HERE = "the network or the router drops it: move closer to the access point; see `t2 hz`"
ONE_DRIVER = "stop one of the two programs; `t2 ls --services` lists them"
LIMIT = "`t2 echo safety/state --field limit_sources` shows who limits, and why"
LIMIT_SILENT = "start its program, check its network and certificate; see safety.limits"
RESET = "when it is safe: `t2 call safety/reset`, or R in `t2 drive`"

ROS_GATEWAY = "start it: `t2 up --ros2`, or `systemctl enable --now t2-ros2` (docs/ros2.md)"
ROS_HIDDEN = "this laptop's certificate may not read them: run `t2 doctor` on the robot"
ROS_TWICE = "stop one of them, or give each robot its own ros2.namespace or ros2.domain"
ROS_NO_NODE = (
    "is RMW_IMPLEMENTATION=rmw_zenoh_cpp set, and does the laptop's router or client connect to "
    "this robot? See docs/ros2.md"
)
ROS_DOMAIN = "set ROS_DOMAIN_ID of these nodes, or ros2.domain of the robot"
ROS_TYPE = "use the type of the table in docs/ros2.md; see ros2.cmd_vel"
ROS_HASH = "its ROS 2 distribution or its copy of this type is another one; Humble is not supported"

# By the names of the causes in safety's state.
CAUSES = {
    "contact": BUMPER,
    "estop": RESET,
    "estop_reader": f"safety had lost the router; {RESET}",
    "estop_keepalive": f"start its pendant, page or `t2 estop --keepalive NAME`; {RESET}",
    "predecessor": RESET,
    "runaway": f"check the wheels and the ground; {RESET}",
    "uncommanded_motion": f"check for a push or a slope; {RESET}",
    "not_stopping": "use the switch on the vehicle; then check its brakes and the ground",
    "driver_left": DRIVER,
    "driver_right": DRIVER,
    "flapping": f"find the input that is intermittent (t2 echo evt/safety); {RESET}",
    "leaving": START,
    "starting": "wait; if it lasts, see the sensors above",
    "link": BOARD_LOST,
    "switches": SWITCHES,
    "bumper": SILENT,
    "bumper_lossy": "check the cable and the board's load: t2 echo tel/bridge/bumper",
    "silent": SILENT,
    "unarmed": "see the link above: the bridge reports what it waits for",
    "limit_stop": f"clear the area; then release the controls and drive; {LIMIT}",
    "limit_silent": LIMIT_SILENT,
    "two_publishers": ONE_DRIVER,
    "neutral": "release the controls, then drive",
    "blocked": "drive another way, or remove the obstacle",
    "no_request": "",
    "release": "",
    "limit": LIMIT,
    "obstacle": "drive another way, or remove the obstacle",
    "sonar": SONAR_FAULT,
}
# Causes of normal operation, with or without a driver.
NORMAL = ("no_request", "release", "neutral", "obstacle", "blocked", "limit", "limit_stop")

FAULTS = {
    "over_current": "over-current: a wheel is blocked",
    "over_voltage": "over-voltage",
    "encoder": "invalid encoder signal: the encoder's cable",
    "under_voltage": "under-voltage: the battery",
    "overload": "overload for too long",
}
