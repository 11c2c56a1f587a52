"""Keystrokes: the meaning of one, on keyboards that are not Latin, too.

============================================ ===========================================
keystroke                                    counts as
============================================ ===========================================
compatibility form of a letter, as full-width its letter; upper case makes no difference
letter at the place of E in another layout   E, with any modifier: an emergency stop
                                             that nobody wanted does no harm
its place, where the terminal reports it     the letter of this place on a Latin keyboard
other letters                                none: their places differ between layouts
============================================ ===========================================
"""

import re
import unicodedata

from t2.messages import Phrase, Phrases

# Letters at the place of E. Latin; Russian, Serbian and Bulgarian; Greek; Hebrew; Arabic; Korean;
# Thai.
ESTOP_LETTERS = frozenset(unicodedata.normalize("NFKC", letter) for letter in "eуеεקثㄷำ")
STOPS = frozenset(("space", "ctrl+@", "ctrl+space", "alt+space"))
SILENT = ("_shift", "_control", "_alt", "_super", "_hyper", "_meta", "_lock")
# A keystroke of the kitty protocol with its alternates: the shifted one, and that of its place.
PLACED = re.compile(
    r"\x1b\[(?P<code>\d+):\d*(?::(?P<place>\d+))?(?P<modifiers>;\d*)?(?P<text>;\d*)?u"
)


def keystroke_of(name: str, character: str | None) -> str:
    """Return what a keystroke counts as, by the terminal library's name and character."""
    name = name.removeprefix("shift+")
    letter = unicodedata.normalize("NFKC", character or "").lower()
    if {letter, name.rpartition("+")[2].lower()} & ESTOP_LETTERS:
        return "e"
    if name in STOPS or letter == " ":
        return "space"
    return letter if letter.isprintable() and letter and "+" not in name else name.lower()


def without_alternates(sequence: str) -> str:
    """Return a sequence of the kitty protocol with one letter: its own, or that of its place."""
    found = PLACED.fullmatch(sequence)
    if not found:
        return sequence
    code, place, modifiers, text = found.group("code", "place", "modifiers", "text")
    if place and int(code) > 127:  # no ASCII letter
        return f"\x1b[{place}{modifiers or ''}u"
    return f"\x1b[{code}{modifiers or ''}{text or ''}u"


def no_function(keystroke: str) -> Phrases:
    """Return the notice of one without a function; empty for a modifier or lock alone."""
    if keystroke.endswith(SILENT):
        return ()
    if keystroke.isascii():
        return (Phrase("keystroke.no_function", {"keystroke": keystroke.upper()}),)
    return Phrase("keystroke.no_function", {"keystroke": keystroke}), Phrase("keystroke.layout")
