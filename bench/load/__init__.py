"""Throughput of the bridge, and CPU and memory of the stack on board."""
