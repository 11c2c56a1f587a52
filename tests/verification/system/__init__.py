"""Tests of verification.system."""
