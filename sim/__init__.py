"""The simulated vehicle: its main board as a UDP peer, and the world around it."""
