"""Telemetry path: how soon a consumer has what the board measured, and how old safety's is."""
