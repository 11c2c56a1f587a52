"""Proof of localization: random vehicles with random sources of fixes, against the truth."""
