"""Proof of patrol: random vehicles drive rounds on random routes, against the truth."""
