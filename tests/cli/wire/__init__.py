"""Tests of t2 wire."""
