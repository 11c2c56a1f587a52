"""The teleop screen without a terminal; cursor queries are answered at once."""

import re

from textual.events import CursorPosition

from services.teleop.app import TeleopApp


class LocalTerminalApp(TeleopApp):
    """Answers its own cursor queries, like a local terminal."""

    def query_terminal(self, question: str) -> None:
        """Answer a cursor query."""
        if place := re.search(r"\[(\d+);(\d+)H", question):
            row, column = map(int, place.groups())
            self.post_message(CursorPosition(column - 1, row - 1))
