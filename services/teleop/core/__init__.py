"""What teleop decides: which keys and sticks count, and what they request. Pure."""
