"""Simulated vehicles in simulated time."""
