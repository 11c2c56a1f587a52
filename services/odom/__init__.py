"""Odometry: pose and twist from the board's counters and velocities."""
