"""``t2 wire``: captured frames, decoded."""
