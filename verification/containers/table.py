"""What was looked at, what was seen, and whether it was as it should be: a table."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Row:
    """One line."""

    what: str
    seen: str
    fine: bool
    took_s: float


def markdown(rows: list[Row]) -> str:
    """Return the table."""
    lines = [
        f"| {row.what} | {_cell(row.seen)} | {'ok' if row.fine else 'WRONG'} | {row.took_s:.0f} s |"
        for row in rows
    ]
    return "\n".join(["| what | seen | | took |", "| --- | --- | --- | --- |", *lines])


def _cell(text: str) -> str:
    """Return a text in one line that ends no cell."""
    return " ".join(text.replace("|", "/").split())[:400]
