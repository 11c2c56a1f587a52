"""The motion panel: a table of speeds, pose, board, motors and driver."""

import math

from rich.text import Text

from common.messages import Driver
from services.teleop.view import View

GOOD, WARN, BAD, DIM = "green", "bold yellow", "bold red", "grey58"
NO_DATA = ("no data", DIM)

Part = tuple[str, str]  # text and its style


def motion(view: View) -> Text:
    """Return the table: eleven rows, or ten during a contact, whose panel needs the room."""
    rows = [*_speeds(view), ("pose", _pose(view)), ("odom", _odom(view)), ("board", _link(view))]
    if not (view.safety and view.safety.release):
        rows.append(("rates", _rates(view)))
    rows += [
        ("motor L", Text(*_faults(view.left))),
        ("motor R", Text(*_faults(view.right))),
        ("driver", _driver(view)),
        ("gamepad", _gamepad(view)),
    ]
    return Text("\n", no_wrap=True).join(
        Text.assemble((f"{name:<8}", DIM), value) for name, value in rows
    )


def _speeds(view: View) -> list[tuple[str, Text]]:
    requested, limits = view.requested, view.safety.limits if view.safety else None
    backward = requested is not None and requested.linear < 0
    allowed = (limits.backward if backward else limits.forward) if limits else None
    measured = view.velocity
    return [
        ("", Text(f"{'request':>8}{'allowed':>9}{'measured':>10}", style=DIM)),
        ("m/s", _triple(
            requested.linear if requested else None, allowed, measured.linear if measured else None
        )),
        ("rad/s", _triple(
            requested.angular if requested else None,
            limits.angular if limits else None,
            measured.angular if measured else None,
        )),
    ]  # fmt: skip


def _triple(requested: float | None, allowed: float | None, measured: float | None) -> Text:
    short = requested is not None and allowed is not None and abs(requested) > allowed + 0.005
    return Text.assemble(
        (f"{_signed(requested):>8}", "bold" if requested else ""),
        (f"{'-' if allowed is None else f'{allowed:.2f}':>9}", WARN if short else ""),
        (f"{_signed(measured):>10}", "bold cyan" if measured else ""),
    )


def _pose(view: View) -> Text:
    at = view.odometry
    if at is None:
        return Text(*NO_DATA)
    return Text(f"x {at.x:+.2f}  y {at.y:+.2f} m  {math.degrees(at.heading):+.0f}°")


def _odom(view: View) -> Text:
    at = view.odometry
    if at is None:
        return Text(*NO_DATA)
    residual = "-" if at.residual is None else f"{at.residual:+.3f} m"
    slip = ("SLIP", WARN) if at.slip else ("no slip", GOOD)
    return Text.assemble(f"residual {residual}  ", slip)


def _link(view: View) -> Text:
    link = view.link
    if link is None:
        return Text(*NO_DATA)
    if link.state != "up":
        return Text(f"{link.state}: {link.board}", style=BAD)
    if not link.armed:
        return Text(link.waiting or "not armed", style=WARN)
    trip = "" if link.round_trip is None else f"  {link.round_trip * 1e3:.1f} ms"
    return Text(f"{link.board}{trip}", style=GOOD)


def _rates(view: View) -> Text:
    if view.link is None:
        return Text(*NO_DATA)
    fastest = sorted(view.link.rates.items(), key=lambda rate: -rate[1])[:4]
    return Text(" ".join(f"{name[:4].lower()} {rate:.0f}" for name, rate in fastest) or "none")


def _faults(driver: Driver | None) -> Part:
    if driver is None:
        return NO_DATA
    return (" ".join(driver.faults), BAD) if driver.faults else ("ok", GOOD)


def _driver(view: View) -> Text:
    if view.release:
        return Text(f"you, release {view.release}", style=WARN)
    driving = view.safety.source if view.safety else None
    if driving is None:
        return Text("none", style=DIM)
    return Text(f"{driving} (you)" if driving == view.source else driving, style="bold")


def _gamepad(view: View) -> Text:
    if view.move_stick:
        return Text("no event: MOVE THE STICK", style=WARN)
    return Text(view.gamepad)


def _signed(value: float | None) -> str:
    return "-" if value is None else f"{value + 0.0:+.2f}"
