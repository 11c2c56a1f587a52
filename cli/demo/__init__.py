"""``t2 demo``: the lap, a program of the client library, with its table and its plot."""
