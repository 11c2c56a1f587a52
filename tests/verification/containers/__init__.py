"""Tests of verification.containers."""
