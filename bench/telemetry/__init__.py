"""Telemetry path: time from the board to a consumer, and the age of safety's samples."""
