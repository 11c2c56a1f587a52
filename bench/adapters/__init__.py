"""One adapter per bus: a source and a subscriber, and the pair of the benchmark ``reaction``."""
