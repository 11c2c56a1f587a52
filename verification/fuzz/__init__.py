"""Hostile bytes for all that reads bytes from outside: frames, messages, settings."""
