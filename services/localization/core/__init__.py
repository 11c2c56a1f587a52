"""What localization computes: pure, without clock and bus; time comes in as nanoseconds."""
