"""Keystrokes on keyboards of other layouts."""

import pytest

from services.teleop.core.keystroke import keystroke_of, no_function, without_alternates
from t2.messages import Phrase, Phrases


@pytest.mark.parametrize(
    ("name", "character", "keystroke"),
    [
        ("e", "e", "e"),
        *((letter, letter, "e") for letter in "EｅＥуУεΕеЕקثㄷำ𝐞"),
        ("ctrl+e", "\x05", "e"),
        ("ctrl+e", None, "e"),
        ("alt+у", "у", "e"),
        ("alt+ctrl+e", None, "e"),
        ("shift+e", None, "e"),
        ("space", " ", "space"),
        ("ideographic_space", "\u3000", "space"),
        ("ctrl+@", "\x00", "space"),
        ("W", "W", "w"),
        ("ｗ", "ｗ", "w"),
        ("１", "１", "1"),
        ("shift+up", None, "up"),
        ("ctrl+w", None, "ctrl+w"),
        ("alt+w", "w", "alt+w"),
        ("enter", "\r", "enter"),
        ("ц", "ц", "ц"),
        ("é", "é", "é"),
        ("question_mark", "?", "?"),
    ],
)
def test_a_keystroke_by_its_letter(name: str, character: str | None, keystroke: str) -> None:
    assert keystroke_of(name, character) == keystroke


@pytest.mark.parametrize(
    ("sequence", "read"),
    [
        ("\x1b[1091::101;;1091u", "\x1b[101;u"),
        ("\x1b[1091:1059:101;2;1059u", "\x1b[101;2u"),
        ("\x1b[1094::119u", "\x1b[119u"),
        ("\x1b[128::119u", "\x1b[119u"),
        ("\x1b[127::119u", "\x1b[127u"),
        ("\x1b[101:69;2;69u", "\x1b[101;2;69u"),
        ("\x1b[97::113;;97u", "\x1b[97;;97u"),  # A of a French keyboard, at the place of Q
        ("\x1b[1094:1062;2;1062u", "\x1b[1094;2;1062u"),
        ("\x1b[1091;;1091u", "\x1b[1091;;1091u"),
        ("\x1b[A", "\x1b[A"),
        ("w", "w"),
    ],
)
def test_the_place_of_a_key_counts_if_its_letter_is_not_latin(sequence: str, read: str) -> None:
    assert without_alternates(sequence) == read


def named(keystroke: str) -> Phrase:
    return Phrase("keystroke.no_function", {"keystroke": keystroke})


@pytest.mark.parametrize(
    ("keystroke", "notice"),
    [
        ("t", (named("T"),)),
        ("ц", (named("ц"), Phrase("keystroke.layout"))),
        ("left_shift", ()),
        ("caps_lock", ()),
    ],
)
def test_a_keystroke_without_a_function(keystroke: str, notice: Phrases) -> None:
    assert no_function(keystroke) == notice
