"""Faulty sonars, and the operators who may creep past them.

A faulty sonar blocks its sector. An operator can still get past, held and slowly: at the
creep speed, after a neutral request made when the fault had been shown for a second. The operator
must release the controls and hold them again: a hold that began before the fault does not continue
without the sonar. Without fresh ultrasonic samples no operator may creep: all sectors are blocked,
and the acknowledgements end.
"""

from collections.abc import Collection, Mapping

from msgspec import Struct

from common.freshness import NS_PER_S

SHOWN_NS = NS_PER_S  # time for an operator to read it


class Blind(Struct, frozen=True):
    """The sonars without a reading, and the sources that may creep past them."""

    since: Mapping[int, int] = {}  # sonar: since when it has no reading, ns
    known: Mapping[str, frozenset[int]] = {}  # source: the sonars its operator acknowledged

    def after(self, unseen: Collection[int], neutral: Collection[str], now_ns: int) -> "Blind":
        """Return the state now; ``neutral``: the operators' sources that request zero now."""
        since = {sonar: self.since.get(sonar, now_ns) for sonar in unseen}
        shown = frozenset(sonar for sonar, at_ns in since.items() if now_ns - at_ns >= SHOWN_NS)
        known = {source: sonars & since.keys() for source, sonars in self.known.items()}
        for source in neutral:
            known[source] = known.get(source, frozenset()) | shown
        return Blind(since, known)

    def known_to(self, source: str | None) -> frozenset[int]:
        """Return the sonars toward which this source may creep without a reading."""
        return self.known.get(source or "", frozenset())
