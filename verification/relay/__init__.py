"""The time that the relay adds to a reflex."""
