"""The bridge: the board's UDP frames to messages, and safety's motion to frames."""
