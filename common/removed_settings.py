"""Settings of earlier versions, by path, with what replaces them."""

REPLACED = {
    "wire.angular_unit": "wire.command_angular_unit and wire.feedback_angular_unit",
    **{
        f"{section}.i_accept": f"{section}.unsafe_overrides"
        for section in ("safety", "bridge", "board", "bus", "teleop", "metrics")
    },
    "teleop.turbo_linear": "gear 5 of teleop.gears_linear",
    "teleop.turbo_angular": "gear 5 of teleop.gears_angular",
    "teleop.turbo_button": "the gears",
}
LENGTHENED = {
    "bridge": ("lease", "silence", "heartbeat", "echo_timeout", "coast"),
    "safety": (
        "bumper_age", "ultrasonic_age", "velocity_age", "link_age", "switches_age", "driver_age",
        "estop_path_age", "max_echo_age", "runaway_time",
    ),
}  # fmt: skip
CONSTANT = {
    "wire.crc": "CRC-16/ARC, which the board uses",
    "wire.crc_covers": "the payload",
    "bridge.failover": "0.1 s",
    "bridge.answer_timeout": "0.1 s",
    "bridge.bumper_rate": "50 Hz",
    "bridge.ultrasonic_rate": "20 Hz",
    "bridge.mileage_rate": "25 Hz",
    "bridge.driver_rate": "2 Hz",
    "safety.settle": "0.5 s",
    "safety.max_call_age": "1 s",
    "safety.hysteresis": "0.05 m",
    "safety.stuck_travel": "0.5 m",
    "safety.runaway_linear": "0.3 m/s",
    "safety.runaway_angular": "0.5 rad/s",
    "safety.release_lease": "the lease of the source",
    "dashboard.round_trip": "0.35 s, by the heartbeat of safety that the page was shown",
    "dashboard.call_round_trip": "1 s, by the heartbeat of safety that the page was shown",
    "dashboard.messages_per_second": "8 kB/s of each connection",
    "dashboard.connections": "64 pages and 192 requests, of which the oldest makes room",
    "dashboard.connections_per_address": "64 pages and 192 requests of all addresses",
    "dashboard.request_timeout": "until 192 newer requests are open",
    "metrics.host": "127.0.0.1",
    "recorder.roll_size": "200 MB",
    "recorder.roll_time": "600 s",
    "recorder.black_box": "120 s",
    "recorder.black_box_size": "64 MB",
    "recorder.tail": "10 s",
    "ros2.odom_rate": "25 Hz",
    "ros2.bumper_rate": "10 Hz",
    "ros2.sonar_rate": "10 Hz",
    "ros2.diagnostics_rate": "1 Hz",
}
SIMULATED = (
    "brake_range", "bumper_brake", "led_channels", "sonar", "bumper", "body", "drive", "velocity",
    "counters", "firmware", "cable",
)  # fmt: skip
REMOVED = {
    **{path: f"was replaced by {other}" for path, other in REPLACED.items()},
    **{
        f"{section}.{name}": f"was replaced by {section}.stall: it lengthens every time limit "
        "for a computer whose processes stall"
        for section, names in LENGTHENED.items()
        for name in names
    },
    "dashboard.embed": "was removed: open the other page in a window of its own",
    "odom.path_spacing": "was removed: t2 record and t2 report have the path",
    "odom.path_points": "was removed: t2 record and t2 report have the path",
    "dashboard.recordings": "was removed: use t2 info and t2 report",
    "ros2.publish_clock": "was removed: record in ROS, and ros2 bag play --clock",
    **{path: f"is no setting any more, always {value}" for path, value in CONSTANT.items()},
    **{
        f"sim.{name}": "is no setting any more; a profile changes the simulated vehicle: "
        "--profile FILE of t2 sim, t2 up and t2 demo (sim/README.md)"
        for name in SIMULATED
    },
}
