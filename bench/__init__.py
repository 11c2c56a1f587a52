"""Benchmarks of T2 and its alternatives on one host."""
