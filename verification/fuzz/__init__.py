"""Fuzzing of all parsers of external input: frames, messages, settings."""
