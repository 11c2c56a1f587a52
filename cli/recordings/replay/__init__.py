"""``t2 replay``: recordings onto the bus, or their raw frames to a bridge."""
