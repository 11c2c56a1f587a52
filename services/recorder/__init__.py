"""Recorder: every key to an MCAP file, and a black box of the last minutes."""
