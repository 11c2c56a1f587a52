"""Frames and messages to bytes and back: T2's way beside others', with the same checks."""
