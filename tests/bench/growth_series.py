"""Made-up curves of growth."""

from bench.growth import measure, page
from bench.series import Series


def made_up() -> list[Series]:
    """Return curves that bend at 10."""
    made = []
    for name in page.CURVES:
        for number, ns in ((1, 1000), (10, 2000), (100, 90_000)):
            arrived = 0.07 if number == 100 else 1.0
            made += measure.point((name, str(number)), {"router": ns}, [ns] * 5, arrived)
    return made
