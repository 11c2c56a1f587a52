"""The units under a real systemd: ``make systemd-test``."""
