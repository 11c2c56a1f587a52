"""What teleop decides: which keystrokes and sticks count, and what they request. Pure."""
