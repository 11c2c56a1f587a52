"""Tests of the t2 command."""
