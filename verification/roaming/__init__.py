"""Driving over a disturbed link between two hosts."""
