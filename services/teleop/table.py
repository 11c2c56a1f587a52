"""The motion panel: speeds, pose, board, motors, who drives, as a table."""

import math

from rich.text import Text

from common.messages import Driver
from services.teleop.view import View

GOOD, WARN, BAD, DIM = "green", "bold yellow", "bold red", "grey58"
NO_DATA = ("no data", DIM)

Part = tuple[str, str]  # words and their style


def motion(view: View) -> Text:
    """Return the whole table, eleven rows; ten during a contact, which needs room elsewhere."""
    rows = [*_speeds(view), ("pose", _pose(view)), ("odom", _odom(view)), ("board", _link(view))]
    if not (view.safety and view.safety.release):
        rows.append(("rates", _rates(view)))
    rows += [
        ("motor L", Text(*_faults(view.left))),
        ("motor R", Text(*_faults(view.right))),
        ("driver", _who(view)),
        ("gamepad", _gamepad(view)),
    ]
    return Text("\n", no_wrap=True).join(
        Text.assemble((f"{name:<8}", DIM), value) for name, value in rows
    )


def _speeds(view: View) -> list[tuple[str, Text]]:
    asked, limits = view.asked, view.safety.limits if view.safety else None
    backward = asked is not None and asked.linear < 0
    allowed = (limits.backward if backward else limits.forward) if limits else None
    measured = view.velocity
    return [
        ("", Text(f"{'asked':>8}{'allowed':>9}{'measured':>10}", style=DIM)),
        ("m/s", _triple(
            asked.linear if asked else None, allowed, measured.linear if measured else None
        )),
        ("rad/s", _triple(
            asked.angular if asked else None,
            limits.angular if limits else None,
            measured.angular if measured else None,
        )),
    ]  # fmt: skip


def _triple(asked: float | None, allowed: float | None, measured: float | None) -> Text:
    short = asked is not None and allowed is not None and abs(asked) > allowed + 0.005
    return Text.assemble(
        (f"{_signed(asked):>8}", "bold" if asked else ""),
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


def _who(view: View) -> Text:
    if view.release:
        return Text(f"you, release {view.release}", style=WARN)
    driving = view.safety.source if view.safety else None
    if driving is None:
        return Text("nobody", style=DIM)
    return Text(f"{driving} (you)" if driving == view.source else driving, style="bold")


def _gamepad(view: View) -> Text:
    if view.move_stick:
        return Text("no event: MOVE THE STICK", style=WARN)
    return Text(view.gamepad)


def _signed(value: float | None) -> str:
    return "-" if value is None else f"{value + 0.0:+.2f}"
