"""Tests of the examples, as a newcomer runs them."""
