"""What the bridge decides: frames, motions, calls and time in; outputs in their order out. Pure."""
