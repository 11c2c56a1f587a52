"""``t2 keys``: a site's own certificate authority."""
