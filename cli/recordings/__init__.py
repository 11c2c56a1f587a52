"""Recordings: made, shown, played back, reported and sent to Foxglove."""
