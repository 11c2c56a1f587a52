"""What the parts ``command`` and ``telemetry`` share: the vehicle, T2's stack, and other buses."""
