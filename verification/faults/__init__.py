"""The fault campaign: the commands that the board receives, and when, after each fault."""
