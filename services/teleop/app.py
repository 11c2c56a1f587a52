"""The screen: panels that are drawn anew five times a second, and keys that go to the desk.

Nothing is decided here. When the desk has sent its last zeros, the screen leaves.
"""

import time
from collections.abc import Callable
from typing import ClassVar

from rich.text import Text
from textual import events
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.widgets import Static

from common.bus.bus import Post
from common.freshness import NS_PER_S
from services.teleop import panels, table
from services.teleop.config import Teleop
from services.teleop.controller import Desk
from services.teleop.hold import Press
from services.teleop.round_trip import NUMBERS, PROBE_S
from services.teleop.sonar_view import around

QUESTION = "\x1b7\x1b[2;{column}H\x1b[6n\x1b8"  # move the cursor, ask for it, move it back
UNANSWERED = 10  # questions; after that many only every tenth is asked
REFRESH_S = 0.2  # a picture costs Textual tens of milliseconds, and keys wait for it


class Panel(Static):
    """A box of text that is only drawn when it has changed."""

    shown: Text | None = None

    def show(self, text: Text) -> None:
        """Draw the text, unless it is there already."""
        if text != self.shown or text.spans != getattr(self.shown, "spans", None):
            self.shown = text
            self.update(text, layout=False)  # its size is the layout's, never the text's


class TeleopApp(App[None]):
    """What the operator sees; keys are posted to the desk, its view is drawn."""

    CSS = """
    Screen { layout: vertical; overflow: hidden; }
    #header { height: 1; padding: 0 1; background: $panel; }
    #safety { height: 4; border: round $primary; padding: 0 1; }
    #middle { height: 13; }
    Panel { text-wrap: nowrap; text-overflow: ellipsis; }
    #around { width: 1fr; height: 100%; border: round $primary; content-align: center middle; }
    #motion { width: 44; height: 100%; border: round $primary; padding: 0 1; }
    #events { height: 1fr; min-height: 3; border: round $primary; padding: 0 1; }
    #hints { height: 2; padding: 0 1; }
    .contact #safety { height: 6; }
    .contact #middle { height: 12; }
    .contact #hints { height: 1; }
    Screen.tall #safety { height: 7; }
    Screen.tall #middle { height: 15; }
    .contact Screen.tall #safety { height: 9; }
    .contact Screen.tall #hints { height: 2; }
    """
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("q,Q,ctrl+c,ctrl+q", "leave", "quit", priority=True)
    ]

    def __init__(
        self,
        desk: Desk,
        post: Post,
        ended: Callable[[], bool],
        hold: Teleop,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        super().__init__()
        self._clock = clock
        self._desk = desk
        self._post = post
        self._ended = ended
        self._hold = hold
        self._leaving = False
        self._view = desk.view  # as drawn last
        self._asked = 0  # questions to the terminal
        self._unanswered = 0  # in a row
        self._header, self._hints = Panel(id="header"), Panel(id="hints")
        self._safety, self._around = titled("safety"), titled("around")
        self._motion, self._events = titled("motion"), titled("events")

    def compose(self) -> ComposeResult:
        """Lay the panels out."""
        yield self._header
        yield self._safety
        with Horizontal(id="middle"):
            yield self._around
            yield self._motion
        yield self._events
        yield self._hints

    def on_mount(self) -> None:
        """Begin to draw."""
        self.set_interval(REFRESH_S, self.draw)
        self.set_interval(PROBE_S, self.probe)

    def on_resize(self, event: events.Resize) -> None:
        """Give a tall terminal more room around the vehicle."""
        self.screen.set_class(event.size.height >= 30, "tall")

    def draw(self) -> None:
        """Draw what is known now; leave once the desk has closed."""
        if self._ended():
            self.exit()
            return
        now_ns = self._clock()
        self._post(lambda: self._desk.watch(now_ns))
        self._view = view = self._desk.view
        size = self._around.content_size
        self._header.show(panels.header(view))
        self.set_class(panels.release(view) is not None, "contact")
        self._safety.show(panels.safety(view, self._safety.content_size.height))
        self._around.show(around(view.ultrasonic, view.bumper, size.width, size.height))
        self._motion.show(table.motion(view))
        size = self._events.content_size
        self._events.show(panels.events(view, size.height, size.width))
        self._hints.show(panels.hints(view, self._hold.hold_first, self._hold.hold))

    def probe(self) -> None:
        """Query the terminal's cursor, at a column that is this query's number."""
        if self._leaving:
            return  # the shell would read the answer as input
        self._asked += 1
        if self._unanswered >= UNANSWERED and self._asked % UNANSWERED:
            return  # a terminal that does not read: its queue must not fill up
        self._unanswered += 1
        number, now_ns = self._asked % max(1, min(NUMBERS, self.size.width)), self._clock()
        self._post(lambda: self._desk.terminal.sent(number, now_ns))
        self.query_terminal(QUESTION.format(column=number + 1))

    def query_terminal(self, question: str) -> None:
        """Write to the terminal after what was drawn so far."""
        if self._driver is not None:
            self._driver.write(question)

    def on_cursor_position(self, event: events.CursorPosition) -> None:
        """Pass an answer on."""
        self._unanswered = 0
        number, at_ns = event.x, self._came_ns(event)
        self._post(lambda: self._desk.terminal.answered(number, at_ns))

    def on_key(self, event: events.Key) -> None:
        """Hand a key over; CapsLock and shift make no difference."""
        key = event.key.removeprefix("shift+").lower()
        press = Press(key, self._came_ns(event), self._view.safety)
        self._post(lambda: self._desk.press(press, self._clock()))

    def _came_ns(self, event: events.Event) -> int:
        """Return when an event was read from the terminal."""
        return self._clock() - round((time.monotonic() - event.time) * NS_PER_S)

    def on_app_blur(self) -> None:
        """Let go when the terminal loses the focus: the repeats go elsewhere."""
        self._post(self._desk.let_go)

    def action_leave(self) -> None:
        """Ask the desk for its last zeros; ``draw`` leaves after them, a second ask at once."""
        if self._leaving:
            self.exit()
        self._leaving = True
        self._post(self._desk.leave)


def titled(name: str) -> Panel:
    """Return a panel with a border that bears its name."""
    panel = Panel(id=name)
    panel.border_title = name
    return panel
