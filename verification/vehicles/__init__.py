"""Simulated vehicles in simulated time: how far an unkind one comes."""
