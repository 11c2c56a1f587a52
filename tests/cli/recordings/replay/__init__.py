"""Tests of t2 replay."""
