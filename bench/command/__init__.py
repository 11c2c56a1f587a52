"""Command path: how soon the board has the frame that a request to move comes to."""
