"""What the part ``codec`` says in the document. Pure."""

from collections.abc import Mapping, Sequence

from bench.codec.values import FRAMES, MESSAGES
from bench.series import Series

WAYS = "encode", "decode"
FIGURES = "p50", "p99", "p99.9", "of T2's"
OURS = "T2"


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks of the document by their names."""
    by_name = {each.name: each for each in series}
    return {
        "frames": table("frame", by_name, list(FRAMES)),
        "messages": table("message", by_name, list(MESSAGES)),
        "frames_verdict": verdict(by_name, list(FRAMES), "struct"),
        "messages_verdict": verdict(by_name, list(MESSAGES), "msgpack by hand"),
        "samples": f"{min(len(each.samples_ns) for each in series):,}",
    }


def table(head: str, by_name: Mapping[tuple[str, ...], Series], names: Sequence[str]) -> str:
    """Return a row for each codec of each of these, times in us a call."""
    columns = [head, "by", "bytes", *(f"{way} {figure}" for way in WAYS for figure in FIGURES)]
    lines = [columns, ["---"] * len(columns)]
    for name in names:
        for codec in codecs(by_name, name):
            cells = [name, codec, by_name[name, codec, "encode"].note]
            for way in WAYS:
                one = by_name[name, codec, way]
                cells += [_us(one.p50_ns), _us(one.p99_ns), _us(one.p999_ns)]
                cells.append(f"× {one.ratio(by_name[name, OURS, way]):.2f}")
            lines.append(cells)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def verdict(by_name: Mapping[tuple[str, ...], Series], names: Sequence[str], floor: str) -> str:
    """Say where the median of T2 is above that of the floor."""
    slower = [
        f"{name}, {way} × {ratio:.2f}"
        for name in names
        for way in WAYS
        if (ratio := by_name[name, OURS, way].ratio(by_name[name, floor, way])) > 1
    ]
    of = len(names) * len(WAYS)
    if not slower:
        return f"T2 is nowhere slower than {floor}."
    return f"T2 is slower than {floor} in {len(slower)} of {of}: {'; '.join(slower)}."


def codecs(by_name: Mapping[tuple[str, ...], Series], name: str) -> list[str]:
    """Return who has rows of this frame or message, in the order of measuring."""
    return list(dict.fromkeys(codec for what, codec, _ in by_name if what == name))


def _us(ns: float) -> str:
    return f"{ns / 1000:.2f}"
