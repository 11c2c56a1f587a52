"""Tests of the random vehicles."""
