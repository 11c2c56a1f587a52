"""Laps with random faults and SIGKILL, and resource usage: ``make soak``."""
