"""Teleop: an operator's keys and sticks to requests to move."""
