"""Tests of verification.ros2."""
