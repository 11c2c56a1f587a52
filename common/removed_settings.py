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
CONSTANT = {
    "ros2.odom_rate": "25 Hz",
    "ros2.bumper_rate": "10 Hz",
    "ros2.diagnostics_rate": "1 Hz",
}
REMOVED = {
    **{path: f"was replaced by {other}" for path, other in REPLACED.items()},
    **{path: f"is no setting any more, always {value}" for path, value in CONSTANT.items()},
}
