"""What safety decides: pure, with the time as `now_ns`."""
