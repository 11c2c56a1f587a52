"""Tests of t2 checkout."""
