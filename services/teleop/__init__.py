"""Teleop: drive requests from an operator's keyboard and gamepad."""
