"""CPU and delay over the number of consumers and bytes."""
