"""What to do about what is wrong, in the operator's words. Pure."""

REFUSED = (
    "on the robot: is `t2 up` on? The router listens on its own host alone as shipped; "
    "docs/security.md says how to let laptops in"
)
NO_WAY = "join the robot's Wi-Fi; then --set bus.connect=tcp/ROBOT:7447 with the robot's address"
NO_NAME = "write the address in numbers, or correct bus.connect"
NO_SOCKET = "the router makes this file: start it, or correct bus.connect"
KEYS = "`t2 keys list` says what is valid until when; renew it, and copy its folder here anew"
NOT_A_ROUTER = "it hangs, wants TLS, or is no router: restart it, or correct bus.connect"
START = "on the robot: `t2 up`, or start it alone; when its process is there, it hangs: end that"
HANGS = "end its process; what supervises it starts it anew"
TWICE = "end one of them: each robot has one of each; look for a second `t2 up`"
UPDATE = "install one version on both, and start the robot's services anew"
RIGHTS = "the router's access rules let this laptop's certificate watch alone"
BLIND = "the router's access rules do not let this laptop read: use another certificate"
CLOCK = "set both clocks, with chrony or NTP; driving does not need it, records do"
SLOW_WAY = "get nearer to the access point; safety refuses requests that are under way too long"
HELD_UP = "find out what else takes its processor"
UNDECODABLE = "another version publishes there, or a stranger"

BOARD_NEVER = (
    "is the board on, its cable in, and this robot's address the one that it sends to "
    "(board.listen_address; 10.7.5.220 on the vehicle)?"
)
BOARD_LOST = "look at the board's power and cable; it comes back by itself"
BOARD_REFUSED = "`t2 wire decode` shows what is wrong with the frames; see wire.crc"
SEND_ERRORS = "look at the robot's network interface, its firewall and the address in board.address"
SWITCHES = """t2 call bridge/switches '{"ultrasonic_brake": true, "bumper_brake": true}'"""
BUMPER = "free it; if it cannot be freed: `t2 drive`, hold F to creep off; then reset"
SONAR_FAULT = "look at its cable; the vehicle does not move into its sector until it measures"
SONAR_NEAR = "take away what covers it"
DRIVER = "switch the vehicle off and on; look at what the fault names; then reset"
SILENT = "the board does not send it: look at the board; `t2 hz` shows the rate"
ONE_DRIVER = "end one of the two programs; `t2 services` shows who is there"
RESET = "when all is safe: `t2 call safety/reset`, or R in `t2 drive`"

# By the causes of safety's state.
CAUSES = {
    "contact": BUMPER,
    "estop": RESET,
    "estop_reader": f"safety had lost the router; {RESET}",
    "predecessor": RESET,
    "runaway": f"look at the wheels and what they stand on; {RESET}",
    "uncommanded_motion": f"look for a push or a slope; {RESET}",
    "not_stopping": "use the switch on the vehicle; then look at its brakes and the ground",
    "driver_left": DRIVER,
    "driver_right": DRIVER,
    "flapping": f"find out which input comes and goes (t2 echo evt/safety); {RESET}",
    "leaving": START,
    "starting": "wait; when it lasts: see the sensors above",
    "link": BOARD_LOST,
    "switches": SWITCHES,
    "bumper": SILENT,
    "bumper_lossy": "look at the cable and the board's load: t2 echo tel/bridge/bumper",
    "silent": SILENT,
    "unarmed": "see the link above: the bridge says what it waits for",
    "two_publishers": ONE_DRIVER,
    "neutral": "let go of the controls, then drive",
    "blocked": "drive another way, or clear it",
    "no_request": "",
    "release": "",
    "obstacle": "drive another way, or clear it",
    "sonar": SONAR_FAULT,
}
# These are how it is when nobody drives, or somebody does.
NORMAL = ("no_request", "release", "neutral", "obstacle", "blocked")

FAULTS = {
    "over_current": "it drew too much current: a wheel that is blocked",
    "over_voltage": "its voltage is too high",
    "encoder": "its encoder is not understood: the encoder's cable",
    "under_voltage": "its voltage is too low: the battery",
    "overload": "it worked too hard for too long",
}
