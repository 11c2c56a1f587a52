"""Contact to BREAK: reaction time from a bumper hit at the board to BREAK."""
