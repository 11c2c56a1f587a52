"""Contact to BREAK: how soon the board is told to stop after it has reported a bumper hit."""
