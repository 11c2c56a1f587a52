"""Recorder: writes every key to MCAP files and keeps a black box of the last minutes."""
