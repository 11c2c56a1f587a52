"""``t2 report``: a recording as one page."""
