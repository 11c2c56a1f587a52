"""Made-up samples of load and throughput."""

from bench.load import page
from bench.series import Series

PROCESSES = {
    page.CHAIN: ("router", "bridge"),
    page.BARE: ("at the board", "decides"),
    page.BUS: ("router", "decides"),
}


def made_up() -> list[Series]:
    """Return 6,000 frames/s to one consumer and 1,000 to five, with the cost."""
    tried = {("1", 6000): "", ("1", 8000): "9 in the socket", ("1", 10_000): ""}
    tried |= {("5", 1000): "", ("5", 2000): "7 in the socket", ("20", 500): "much"}
    made = []
    for (count, hz), note in tried.items():
        name = "frames", count, str(hz)
        made.append(Series(name=(*name, "delay"), samples_ns=[400_000] * 9, note=note))
        for candidate in ("router", "bridge", "machine"):
            made.append(Series(name=(*name, candidate), samples_ns=[250_000_000]))
    for candidate, each in ((page.CHAIN, 30), (page.BARE, 20), (page.BUS, 25)):
        for what, value in (("shipped", 1e6), ("tenfold", 1e7), ("rss", 3e6), ("pss", 1e6)):
            for name_of in PROCESSES[candidate]:
                made.append(sample(candidate, what, name_of, each * value))
            made.append(sample(candidate, what, page.TOGETHER, 2 * each * value))
    return made


def sample(candidate: str, what: str, process: str, value: float) -> Series:
    return Series(name=(candidate, what, process), samples_ns=[round(value)] * 3)
