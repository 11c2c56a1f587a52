"""The stack and its router: started, supervised and installed."""
