"""Commands that start, supervise and install the stack and its router."""
