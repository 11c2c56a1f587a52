"""Teleop without a network or a terminal: node, gamepad, and an operator at the controller."""

from typing import Any

from common.freshness import NS_PER_S
from common.motion import Twist
from services.teleop.config import TeleopConfig
from services.teleop.controller import Controller
from services.teleop.core.controls import Stick
from services.teleop.core.hold import Press
from services.teleop.event_log import EventLog
from services.teleop.gamepad import Gamepad
from services.teleop.labels import Labels
from services.teleop.view import View
from t2 import keys
from t2.messages import Drive, Phrase, SafetyState
from tests.factories import contact_state, safety_state
from tests.fake_bus import FakeNode
from tests.teleop.inputs import PERIOD_NS, answer

english = Labels().render


class TeleopNode(FakeNode[TeleopConfig]):
    """A node whose logs go to an event log."""

    def __init__(self) -> None:
        self.event_log = EventLog()
        super().__init__("teleop", TeleopConfig())
        self.event_log.capture_logs(self.config.log)


def view(**fields: Any) -> View:
    """Return a view that knows nothing yet, but for the given fields."""
    usual: dict[str, Any] = {
        "robot": "001",
        "source": "teleop",
        "connected": True,
        "gear": 1,
        "top": Twist(0.2, 0.3),
        "gamepad": Phrase("gamepad.none"),
    }
    return View(**usual | fields)


class FakeGamepad(Gamepad):
    """A gamepad with a configured state."""

    def __init__(self) -> None:
        super().__init__(Phrase("gamepad.device", {"device": "Fake Pad"}))
        self.stick: Stick | None = None

    def read(self) -> Stick | None:
        return self.stick


class Operator:
    """A controller with a simulated clock that advances by ticks."""

    def __init__(self) -> None:
        self.node = TeleopNode()
        self.controller = Controller(self.node, self.node.event_log)
        self.now_ns = 100 * NS_PER_S
        self.near = True  # the terminal answers at once
        self.shown: SafetyState | None = None
        answer(self.controller.terminal, self.now_ns)

    def press(self, keystroke: str, waited_s: float = 0.0) -> None:
        at_ns = self.now_ns - round(waited_s * NS_PER_S)
        self.controller.press(Press(keystroke, at_ns, self.shown), self.now_ns)

    def wait(self, seconds: float) -> None:
        """Advance the clock without ticks; then the terminal answers at once."""
        self.now_ns += round(seconds * NS_PER_S)
        answer(self.controller.terminal, self.now_ns)

    def tell_safety(self, **fields: Any) -> None:
        self.node.fake.deliver(keys.SAFETY, safety_state(**fields), self.now_ns)

    def tell_contact(self, **fields: Any) -> None:
        """Simulate a pressed bumper in safety's state and on the screen."""
        self.shown = contact_state(**{"boot": 5} | fields)
        self.node.fake.deliver(keys.SAFETY, self.shown, self.now_ns)

    def ticks(self, count: int) -> list[Drive | None]:
        sent = []
        for _ in range(count):
            before, _ = self.node.sent(keys.DRIVE)
            self.controller.tick(self.now_ns)
            after, last = self.node.sent(keys.DRIVE)
            assert after - before <= 1
            sent.append(last if after > before else None)
            self.now_ns += PERIOD_NS
            if self.near:
                answer(self.controller.terminal, self.now_ns)
        return sent

    def speeds(self, count: int) -> list[float | None]:
        return [drive.linear if drive else None for drive in self.ticks(count)]

    @property
    def lines(self) -> list[str]:
        return [english(line.phrases, line.text) for line in self.node.event_log.lines()]

    @property
    def alarm(self) -> str:
        return english(self.controller.view.alarm)

    @property
    def unconfirmed(self) -> str:
        return english(self.controller.unconfirmed)
