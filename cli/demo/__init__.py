"""``t2 demo``: the plan of the lap, its driver, its picture and its score."""
