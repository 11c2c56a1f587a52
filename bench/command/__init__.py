"""Command path: time from a motion request to its frame at the board."""
