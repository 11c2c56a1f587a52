"""Mutation testing as a gate with a list of allowed mutants."""
