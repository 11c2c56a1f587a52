"""Tests of what verifies the stack."""
