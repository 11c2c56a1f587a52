"""Tests of the stack's supervisor and router."""
