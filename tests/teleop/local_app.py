"""Teleop's screen without a terminal: an emulator answers its queries at once."""

import re

from textual.events import CursorPosition

from services.teleop.app import TeleopApp


class LocalTerminalApp(TeleopApp):
    """The screen of a local terminal, which answers each query at once."""

    def query_terminal(self, query: str) -> None:
        """Answer like a terminal."""
        if place := re.search(r"\[(\d+);(\d+)H", query):
            row, column = map(int, place.groups())
            self.post_message(CursorPosition(column - 1, row - 1))
