"""Safety: decides what may move the vehicle, and reports the reason of a stop."""
