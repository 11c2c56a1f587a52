"""The switch of the bumper strip, which may bounce."""

import random

from common.freshness import NS_PER_S

EVEN = 0.5  # chance that a bouncing switch is closed


class Switch:
    """The contact as the board senses it.

    bounce: s after each press and release in which it opens and closes at random; the first reading
    after a change is correct.
    """

    def __init__(self, bounce: float, seed: int) -> None:
        self._bounce_ns = round(bounce * NS_PER_S)
        self._random = random.Random(f"bumper {seed}")
        self._touched = False
        self._until_ns = 0
        self.closed = False

    def touch(self, touched: bool, now_ns: int) -> None:
        """Set whether something presses the strip now."""
        if touched != self._touched:
            self._touched, self._until_ns = touched, now_ns + self._bounce_ns
            self.closed = touched
        elif now_ns < self._until_ns:
            self.closed = self._random.random() < EVEN
        else:
            self.closed = touched
