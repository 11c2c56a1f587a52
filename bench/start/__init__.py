"""Start: time until the first STOP, and memory of each process."""
