"""Keys on the bus; generated from the stack's own by ``make docs``, do not edit."""

from t2 import messages as m

ROOT = "t2/v1"

# By name: the path below the robot, and the type of the message.
TOPICS: dict[str, tuple[str, type[m.Message]]] = {
    "velocity": ("tel/bridge/velocity", m.Velocity),
    "mileage": ("tel/bridge/mileage", m.Mileage),
    "ultrasonic": ("tel/bridge/ultrasonic", m.Ultrasonic),
    "bumper": ("tel/bridge/bumper", m.Bumper),
    "switches": ("tel/bridge/switches", m.Switches),
    "link": ("tel/bridge/link", m.Link),
    "odometry": ("tel/odom/odometry", m.Odometry),
    "safety": ("tel/safety/state", m.SafetyState),
    "events": ("evt/{service}", m.Event),
    "drive": ("@cmd/drive/{source}", m.Drive),
    "limit": ("@cmd/limit/{source}", m.Limit),
}
