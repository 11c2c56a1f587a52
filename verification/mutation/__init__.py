"""Mutation testing as a gate: which mutants may live, and the run that looks for others."""
