"""From nothing to the first STOP: how long each process takes to start, and its memory."""
