"""Relay: a brake on a second computer, between the PC and the main board."""
