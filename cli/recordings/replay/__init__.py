"""Recordings onto the bus again, or their raw frames to a bridge."""
