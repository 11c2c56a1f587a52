"""Tests of verification.mutation."""
