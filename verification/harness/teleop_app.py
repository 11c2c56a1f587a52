"""The screen without a terminal, before an emulator that answers its questions at once."""

import re

from textual.events import CursorPosition

from services.teleop.app import TeleopApp


class NearApp(TeleopApp):
    """Answers itself what it asks the terminal."""

    def query_terminal(self, question: str) -> None:
        """Answer as a terminal does."""
        if place := re.search(r"\[(\d+);(\d+)H", question):
            row, column = map(int, place.groups())
            self.post_message(CursorPosition(column - 1, row - 1))
