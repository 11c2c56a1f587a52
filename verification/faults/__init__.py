"""The fault campaign: what the board was told, and when, after each fault of a catalogue."""
