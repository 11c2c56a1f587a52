"""Search for violations of the invariants in simulated time: stack, oracle, random vehicles."""
