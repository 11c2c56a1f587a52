"""What consumers, robots, keys and bytes cost as there are more of them."""
