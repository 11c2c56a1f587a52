"""Random faults of the catalogue for hours, and resource usage: ``make soak``."""
