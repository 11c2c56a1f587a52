"""Example consumers."""
