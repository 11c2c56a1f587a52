"""Tests of t2 report."""
