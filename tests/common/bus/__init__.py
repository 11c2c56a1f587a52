"""Tests of the bus, over a real router."""
