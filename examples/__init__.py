"""Consumers to begin from."""
