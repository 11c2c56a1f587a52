"""Safety: decides what may move the vehicle, and says why not."""
