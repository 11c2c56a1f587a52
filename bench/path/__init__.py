"""Shared by ``command`` and ``telemetry``: the simulated vehicle, T2's stack, processes."""
