"""``t2 report``: an HTML report of a recording."""
