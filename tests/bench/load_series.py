"""Made-up samples of load and throughput."""

from bench.load import page
from bench.series import Series

PROCESSES = "router", "bridge"
FACTORS = {page.CHAIN: 30, page.OBSERVED: 33, page.BARE: 5, page.BUS: 25, page.POOLED: 20}


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
    for candidate, each in FACTORS.items():
        for what, value in (("cpu", 1e6), ("rss", 3e6), ("pss", 1e6)):
            for name_of in PROCESSES:
                made.append(sample(candidate, what, name_of, each * value))
            made.append(sample(candidate, what, page.TOGETHER, 2 * each * value))
        for link in (page.TO_BOARD, page.TO_BRIDGE, page.CONSUMER):
            made.append(sample(candidate, "bytes", link, 10_000))
    return made


def sample(candidate: str, what: str, process: str, value: float) -> Series:
    return Series(name=(candidate, what, process), samples_ns=[round(value)] * 3)
