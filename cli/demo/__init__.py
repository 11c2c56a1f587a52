"""``t2 demo``: the steps of the lap, its driver, its display and its score."""
