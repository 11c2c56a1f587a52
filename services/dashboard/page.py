"""The page: what stands where, by NiceGUI; our own scripts draw and listen.

No event of the page goes through NiceGUI's socket: a hand on the stick and a stop must not wait
behind anything. Buttons call the scripts, which have a socket of their own.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager

from nicegui import ui

from services.dashboard.config import GEARS
from services.dashboard.texts import table

VIEWPORT = "width=device-width, initial-scale=1, viewport-fit=cover"


def build(robot: str) -> None:
    """Lay the page out, for a newcomer who looks at this robot first."""
    texts = json.dumps(table(), ensure_ascii=False).replace("<", "\\u003c")
    ui.add_head_html(
        '<link rel="stylesheet" href="/t2/dashboard.css">'
        f'<script type="application/json" id="texts">{texts}</script>'
        '<script type="module" src="/t2/dashboard.js"></script>'
    )
    with ui.element("main").props(f"id=page data-robot={robot}"):
        _head()
        _state()
        with ui.element("div").classes("columns"):
            with ui.element("div").classes("column-of-panels"):
                _around()
                _why()
                _board()
            with ui.element("div").classes("column-of-panels"):
                _trail()
                _charts()
            with ui.element("div").classes("column-of-panels"):
                _driving()
                _lights()
        with ui.element("div").classes("columns lower"):
            _lists()
    _dialog()


def word(key: str, tag: str = "span") -> None:
    """Put a text of the table here, in the reader's language."""
    raw(f'<{tag} data-t="{key}"></{tag}>')


def raw(code: str, tag: str = "div") -> None:
    """Put markup of our own here."""
    ui.html(code, sanitize=False, tag=tag).classes("bare")


def button(key: str, ident: str, call: str = "") -> ui.button:
    """Put a button here that calls a script."""
    made = ui.button(color=None).props(f"id={ident} unelevated no-caps").classes("t2-button")
    if call:
        made.on("click", js_handler=f"() => window.t2.{call}")
    with made:
        word(key)
    return made


@contextmanager
def panel(key: str, classes: str = "") -> Iterator[None]:
    """Frame what follows, under a title."""
    with ui.element("section").classes(f"panel {classes}"):
        word(key, "h2")
        yield


def _head() -> None:
    with ui.element("header").props("id=head"):
        raw(
            '<span class="brand">T2</span>'
            '<select id="robots" aria-label="robot"></select>'
            '<span id="link" class="chip"></span><span id="bumper" class="chip"></span>'
            '<span id="driver" class="chip"></span><span id="watching" class="chip quiet"></span>'
        )
        raw(
            '<input id="name" maxlength="24" data-t-placeholder="your_name">'
            '<button id="language" data-t="language"></button>'
            '<button id="theme" data-t-title="theme">◐</button>'
        )
        button("estop", "estop", "estop()")


def _state() -> None:
    raw(
        '<div id="state" data-tone="dark"><div id="verdict"></div>'
        '<div class="reason"><div id="sentence"></div><div id="detail"></div></div>'
        '<div class="figures"><span id="speed">–</span><small data-t="speed"></small>'
        '<span id="turn">–</span><small data-t="turn"></small></div></div>'
    )


def _around() -> None:
    with panel("around", "square"):
        raw('<svg id="around" viewBox="-2.6 -2.6 5.2 5.2" role="img"></svg>')


def _why() -> None:
    with panel("why"):
        raw('<ul id="causes"></ul>')
        word("limits", "h3")
        raw('<div id="limits" class="limits"></div>')


def _trail() -> None:
    with panel("trail", "grow"):
        raw(
            '<div class="tools"><button id="zoom-in">+</button><button id="zoom-out">−</button>'
            '<button id="follow" class="lit" data-t="follow"></button>'
            '<button id="clear" data-t="clear"></button></div><canvas id="trail"></canvas>'
        )


def _charts() -> None:
    with panel("charts"):
        raw(
            '<div class="legend"><i class="asked"></i><span data-t="asked"></span>'
            '<i class="allowed"></i><span data-t="allowed"></span>'
            '<i class="measured"></i><span data-t="measured"></span></div>'
            '<div class="pair-of-charts"><canvas id="chart-speed"></canvas>'
            '<canvas id="chart-turn"></canvas></div>'
        )


def _driving() -> None:
    with panel("drive", "driving"):
        with ui.element("div").classes("row"):
            button("take", "take", "take()")
            button("leave", "leave", "leave()")
        gears = "".join(f'<button data-gear="{n}">{n}</button>' for n in range(1, GEARS + 1))
        raw(
            '<div id="stick" tabindex="-1"><div id="knob"></div></div>'
            '<div id="hold"></div>'
            f'<div id="gears"><span data-t="gear"></span>{gears}<small id="top"></small></div>'
        )
        with ui.element("div").classes("row"):
            button("reset", "reset", "reset()")
            button("release", "release")
        raw('<p class="hint" data-t="hint"></p><p class="hint" id="gamepad"></p>')


def _board() -> None:
    with panel("switches"):
        raw(
            '<div class="pair"><button id="ultrasonic_brake"></button>'
            '<button id="bumper_brake"></button></div>'
        )
    with panel("drivers"):
        raw('<div id="drivers"></div>')


def _lights() -> None:
    fields = (
        ("channel", 1, 255), ("mode", 1, 255), ("lightness", 10, 10),
        ("on_time", 0, 255), ("off_time", 0, 255), ("speed_unit", 0, 255),
    )  # fmt: skip
    rows = "".join(
        f'<label><span data-t="{name}"></span>'
        f'<input type="number" id="lamp-{name}" min="0" max="{top}" value="{value}"></label>'
        for name, value, top in fields
    )
    with panel("lights"):
        raw(f'<div class="lamp">{rows}</div>')
        button("set", "lamp", "lamp()")


def _lists() -> None:
    with panel("events"):
        raw('<ol id="events"></ol>')
    with panel("services"):
        raw('<table id="services"></table>')
    with panel("streams"):
        raw('<table id="streams"></table>')


def _dialog() -> None:
    """Put the one question here that scripts ask by ``confirm``."""
    with ui.element("dialog").props("id=question"):
        raw('<h2 id="question-title"></h2><p id="question-text"></p>')
        with ui.element("div").classes("row"):
            button("yes", "question-yes")
            button("no", "question-no")
    raw('<div id="toasts" role="status"></div>')
