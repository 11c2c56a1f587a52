"""How fast a request may change the velocity; a stop of safety never comes through here."""

from common.motion import Twist, clamp


def ramp(current: Twist, target: Twist, up: Twist, down: Twist, dt_s: float) -> Twist:
    """Return the velocity after ``dt_s`` seconds on the way from current to target.

    ``up`` limits growing and ``down`` shrinking magnitudes, in m/s^2 and rad/s^2.
    """
    return Twist(
        _step(current.linear, target.linear, up.linear * dt_s, down.linear * dt_s),
        _step(current.angular, target.angular, up.angular * dt_s, down.angular * dt_s),
    )


def _step(current: float, target: float, up: float, down: float) -> float:
    """Move one component; a change of direction stops at zero first."""
    if current * target < 0:
        target = 0.0
    step = up if abs(target) > abs(current) else down
    return current + clamp(target - current, step)


def start(measured: Twist, target: Twist) -> Twist:
    """Return where a ramp begins after a stop: what is left of the motion, if it is wanted."""
    return Twist(
        _overlap(measured.linear, target.linear), _overlap(measured.angular, target.angular)
    )


def _overlap(measured: float, target: float) -> float:
    if measured * target <= 0:
        return 0.0
    return measured if abs(measured) < abs(target) else target
