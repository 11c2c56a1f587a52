"""The screen: panels that are redrawn five times a second; presses go to the controller.

The screen decides nothing. It exits when the controller has sent its final zeros.
"""

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual import events
from textual._xterm_parser import XTermParser
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.drivers import linux_driver
from textual.widgets import Static

from common import clock
from common.freshness import NS_PER_S
from common.loop import Post
from common.text import printable
from services.teleop import panels
from services.teleop.config import Teleop
from services.teleop.controller import Controller
from services.teleop.core.hold import Press
from services.teleop.core.keystroke import keystroke_of, without_alternates
from services.teleop.core.round_trip import QUERY_S, place
from services.teleop.labels import Labels

QUERY = "\x1b7\x1b[{row};{column}H\x1b[6n\x1b8"  # move the cursor, query its position, restore it
ALTERNATES = "\x1b[=4;2u"  # the kitty protocol's report of a keystroke's place; others ignore it
QUIT = "q"
MAX_UNANSWERED = 10  # queries; after that only every tenth is sent
TALL = 30  # rows of a terminal with room for more causes
REST = 20  # rows of the other panels, and borders
EVENTS = 3  # of them those of the events, which yield to an alarm
REFRESH_S = 0.2  # Textual needs tens of milliseconds for a redraw, which delay keystrokes


class PlaceParser(XTermParser):
    """Textual's parser, with the places of keystrokes, and for sequences that it cannot read."""

    def _sequence_to_key_events(self, sequence: str, alt: bool = False) -> Iterable[events.Key]:
        try:
            return list(super()._sequence_to_key_events(without_alternates(sequence), alt))
        except ValueError:  # a garbled sequence does not end the program
            return []


vars(linux_driver)["XTermParser"] = PlaceParser  # Textual has no other way to choose it


class Panel(Static):
    """A box of text that is redrawn only when it has changed."""

    shown: Text | None = None

    def show(self, text: Text) -> None:
        """Draw the text, unless it is already shown; with control characters, without styles."""
        if (plain := printable(text.plain, "\n")) != text.plain:
            text = Text(plain, no_wrap=True)
        if text != self.shown or text.spans != getattr(self.shown, "spans", None):
            self.shown = text
            self.update(text, layout=False)  # the layout sets the size, not the text


class TeleopApp(App[None]):
    """The operator's screen: posts presses to the controller and draws its view."""

    CSS_PATH = Path(__file__).with_name("app.tcss")
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("q,Q,ctrl+c,ctrl+q", "leave", "quit", priority=True)
    ]

    def __init__(
        self,
        controller: Controller,
        post: Post,
        ended: Callable[[], bool],
        hold: Teleop,
        labels: Labels,
        *,
        clock: Callable[[], int] = clock.now_ns,
    ) -> None:
        super().__init__()
        self._clock = clock
        self._controller = controller
        self._post = post
        self._ended = ended
        self._hold = hold
        self._leaving = False
        self._view = controller.view  # the last one drawn
        self._queries = 0  # to the terminal
        self._unanswered = 0  # in a row
        self._labels = labels
        self._header, self._hints = Panel(id="header"), Panel(id="hints")
        self._safety, self._around, self._motion, self._events = (
            titled(name, labels) for name in ("safety", "around", "motion", "events")
        )

    def compose(self) -> ComposeResult:
        """Lay out the panels."""
        yield self._header
        yield self._safety
        with Horizontal(id="middle"):
            yield self._around
            yield self._motion
        yield self._events
        yield self._hints

    def on_mount(self) -> None:
        """Start the timers, and ask for the places of keystrokes."""
        self.query_terminal(ALTERNATES)
        self.set_interval(REFRESH_S, self.draw)
        self.set_interval(QUERY_S, self.query_cursor)

    def draw(self) -> None:
        """Redraw all panels; exit once the controller's loop has ended."""
        if self._ended():
            self.exit()
            return
        now_ns, say = self._clock(), self._labels
        self._post(lambda: self._controller.screen_drawn(now_ns))
        self._view = view = self._controller.view
        self._header.show(panels.header(view, say))
        least = 5 if self.size.height >= TALL else 2
        text = panels.safety(view, say, least, self._safety.content_size.width)
        self.set_class(bool(view.alarm), "alarm")
        free = self.size.height - REST + (EVENTS if view.alarm else 0)
        rows = min(text.plain.count("\n") + 1, free)
        self._safety.styles.height = max(least, rows) + 2  # with its borders
        self._safety.show(text)
        self._around.show(panels.around(view, say))
        self._motion.show(panels.motion(view, say))
        size = self._events.content_size
        self._events.show(panels.events(view, say, size.height, size.width))
        self._hints.show(panels.hints(view, say, self._hold.hold_first))

    def query_cursor(self) -> None:
        """Query the cursor position, at a place that identifies the query."""
        if self._leaving:
            return  # the shell would read the answer as input
        self._queries += 1
        if self._unanswered >= MAX_UNANSWERED and self._queries % MAX_UNANSWERED:
            return  # a terminal that does not read: its queue must not fill
        self._unanswered += 1
        where, now_ns = place(self._queries, *self.size), self._clock()
        self._post(lambda: self._controller.terminal.sent(where, now_ns))
        self.query_terminal(QUERY.format(column=where[0] + 1, row=where[1] + 1))

    def query_terminal(self, query: str) -> None:
        """Write a query to the terminal, after the pending output."""
        if self._driver is not None:
            self._driver.write(query)

    def on_cursor_position(self, event: events.CursorPosition) -> None:
        """Post an answer of the terminal to the controller."""
        self._unanswered = 0
        where, at_ns = (event.x, event.y), self._received_ns(event)
        self._post(lambda: self._controller.terminal.answered(where, at_ns))

    def on_key(self, event: events.Key) -> None:
        """Post a press to the controller; CapsLock and shift make no difference."""
        keystroke = keystroke_of(event.key, event.character)
        if keystroke == QUIT:  # of a full-width keyboard
            self.action_leave()
            return
        press = Press(keystroke, self._received_ns(event), self._view.safety)
        self._post(lambda: self._controller.press(press, self._clock()))

    def _received_ns(self, event: events.Event) -> int:
        """Return the time when an event was read from the terminal."""
        return self._clock() - round((time.monotonic() - event.time) * NS_PER_S)

    def on_app_blur(self) -> None:
        """Let go of the controls when the terminal loses the focus, and with it the repeats."""
        now_ns = self._clock()
        self._post(lambda: self._controller.let_go(now_ns))

    def action_leave(self) -> None:
        """Request the final zeros; ``draw`` exits after them. A second call exits at once."""
        if self._leaving:
            self.exit()
        self._leaving = True
        self._post(self._controller.leave)


def titled(name: str, say: Labels) -> Panel:
    """Return a panel with its name as the border title."""
    panel = Panel(id=name)
    panel.border_title = say(f"title.{name}")
    return panel
