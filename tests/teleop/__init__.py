"""Tests of teleop."""
