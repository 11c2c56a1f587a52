"""CPU and delay over the number of consumers, robots, keys and bytes."""
