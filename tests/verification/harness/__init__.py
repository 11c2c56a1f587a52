"""Tests of verification.harness."""
