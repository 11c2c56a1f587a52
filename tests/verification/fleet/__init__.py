"""Tests of verification.fleet."""
