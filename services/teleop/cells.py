"""Layout of text in the cells of a terminal: a Chinese character takes two columns."""

from collections.abc import Iterator

from rich.cells import cell_len, chop_cells, set_cell_size

CLOSING = "，、。：；！？、）”…"  # does not begin a row
OPENING = "（“"  # does not end a row


def left(text: str, columns: int) -> str:
    """Return the text in so many columns, at the left; a longer one is cut."""
    return set_cell_size(fitted(text, columns), columns)


def right(text: str, columns: int) -> str:
    """Return the text in so many columns, at the right."""
    return " " * (columns - cell_len(text)) + text


def centred(text: str, columns: int) -> str:
    """Return the text in the middle of so many columns."""
    return left(" " * ((columns - cell_len(text)) // 2) + text, columns)


def fitted(text: str, columns: int) -> str:
    """Return the text, cut with an ellipsis if it has more columns."""
    if cell_len(text) <= columns:
        return text
    return set_cell_size(text, columns - 1).rstrip() + "…"


def wrap(text: str, columns: int, indent: int = 0) -> list[str]:
    """Return the rows of a text, broken between words and Chinese characters.

    ``indent`` is the number of columns that the first row has less.
    """
    rows, row, free = [], "", columns - indent
    for piece in _pieces(text):
        if cell_len(row + piece) <= free:
            row += piece
            continue
        if row or free < columns:  # or after the indent
            rows.append(row.rstrip())
        *whole, row = chop_cells(piece.lstrip(), columns) or [""]
        rows += whole
        free = columns
    return [*rows, row.rstrip()] if row.strip() else rows


def _pieces(text: str) -> Iterator[str]:
    """Yield what is not broken: commands in backticks, words, Chinese characters.

    Each has the spaces before it.
    """
    piece = ""
    for char in " ".join(text.split()):
        if piece.strip() and piece.count("`") != 1 and _may_break(piece[-1], char):
            yield piece
            piece = ""
        piece += char
    if piece:
        yield piece


def _may_break(before: str, after: str) -> bool:
    if after == " ":
        return True
    is_wide = cell_len(before) == 2 or cell_len(after) == 2
    return is_wide and after not in CLOSING and before not in OPENING
