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
from services.teleop import panels, table
from services.teleop.config import Teleop
from services.teleop.desk import Desk
from services.teleop.drawing import around

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
    Screen.tall #safety { height: 7; }
    Screen.tall #middle { height: 15; }
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
        self._header = Panel(id="header")
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
        yield Panel(panels.hints(self._hold.hold_first, self._hold.hold), id="hints")

    def on_mount(self) -> None:
        """Begin to draw."""
        self.set_interval(REFRESH_S, self.draw)

    def on_resize(self, event: events.Resize) -> None:
        """Give a tall terminal more room around the vehicle."""
        self.screen.set_class(event.size.height >= 30, "tall")

    def draw(self) -> None:
        """Draw what is known now; leave once the desk has closed."""
        if self._ended():
            self.exit()
            return
        self._post(lambda: self._desk.watch(self._clock()))
        view, size = self._desk.view, self._around.content_size
        self._header.show(panels.header(view))
        self._safety.show(panels.safety(view, self._safety.content_size.height))
        self._around.show(around(view.ultrasonic, view.bumper, size.width, size.height))
        self._motion.show(table.motion(view))
        self._events.show(panels.events(view, self._events.content_size.height))

    def on_key(self, event: events.Key) -> None:
        """Hand a key over; CapsLock and shift make no difference."""
        key, now_ns = event.key.removeprefix("shift+").lower(), self._clock()
        self._post(lambda: self._desk.press(key, now_ns))

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
