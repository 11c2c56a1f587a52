"""Tests of t2 demo."""
