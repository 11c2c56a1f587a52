"""A fleet on one machine: real stacks, light robots, one site router, and what they cost it."""
