"""Tests of the benchmarks: not how fast, but whether the same is compared."""
