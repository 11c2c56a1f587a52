"""``t2 keys``: the certificate authority of a site."""
