"""Tests of verification.faults."""
