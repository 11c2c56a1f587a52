"""Tests of verification.outside."""
