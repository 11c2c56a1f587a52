"""Tests of the tools that look at the bus."""
