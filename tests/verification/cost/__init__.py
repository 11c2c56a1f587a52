"""Tests of verification.cost."""
