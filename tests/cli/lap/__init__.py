"""Tests of the demo's lap."""
