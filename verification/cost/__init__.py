"""What the hot paths cost, in counts that a noisy machine does not change."""
