"""Cost of a fleet on a site router: real stacks and simulated robots on one host."""
