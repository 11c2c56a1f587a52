"""Cost of the hot paths in counts that do not depend on the load of the host."""
