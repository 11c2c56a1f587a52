"""Made-up curves of growth."""

from bench.growth import measure, page
from bench.series import Series


def made_up() -> list[Series]:
    """Return curves that bend at 10; nothing has come from the robots."""
    made = []
    for name in page.CURVES:
        for number, ns in ((1, 1000), (10, 2000), (100, 90_000)):
            note = "7% arrived" if number == 100 else ""
            point = measure.point((name, str(number)), {"router": ns}, [ns] * 5, 1.0, note)
            made += [one for one in point if name != page.ROBOTS or one.name[2] == "router"]
            if name == page.ROBOTS:
                made.append(Series(name=(name, str(number), "delay"), samples_ns=[]))
    return made
