"""``python -m bench.reaction.resetter ENDPOINT``: an operator that resets every latch."""

import sys

from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from common.operator import reset_request
from common.settings import BusSettings


class Resetter:
    """Calls reset, one call at a time, while anything is latched."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._pending = False
        self._state: m.SafetyState | None = None
        bus.subscribe(keys.SAFETY, self._on_state)
        bus.subscribe(keys.MOTION, self._on_motion)  # more frequent than the state

    def _on_state(self, arrival: Arrival[m.SafetyState]) -> None:
        self._state = arrival.message

    def _on_motion(self, arrival: Arrival[m.Motion]) -> None:
        state = self._state
        if arrival.message.latched and state is not None and state.latched and not self._pending:
            self._pending = True
            self._bus.call(keys.RESET, reset_request(state), self._answered, self._answered, 1.0)

    def _answered(self, _: object) -> None:
        self._pending = False


def main() -> None:
    """Reset until killed."""
    loop = Loop()
    bus = Bus(BusSettings(connect=(sys.argv[1],)), "001", loop.post)
    Resetter(bus)
    bus.open()
    loop.run()


if __name__ == "__main__":
    main()
