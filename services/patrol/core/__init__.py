"""What patrol decides: pure."""
