"""Teleop: drive requests from an operator's keys and gamepad."""
