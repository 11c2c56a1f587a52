"""Contact to BRAKE: reaction time from a bumper hit at the board to BRAKE."""
