"""Verification of the gateway to ROS 2 with independent peers, and its cost."""
