"""The invariants: a search with random events, and mutants of the protections."""
