"""Invariants 1 to 5 of the safety case, on the frames that a board receives, in simulated time."""
