"""T2's installations: containers, systemd units, and the relay's image."""
