"""Tests of verification.fuzz."""
