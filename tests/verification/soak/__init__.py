"""Tests of verification.soak."""
