"""Whose monotonic clock a message was stamped by.

All processes of a host share one monotonic clock, and it begins anew with the host: its boot is its
name. Two hosts that were restored from one image may bear the same name; whoever takes a difference
of such times checks that it is plausible, too.
"""

import uuid
from pathlib import Path

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


def host_id(boot_id: Path = BOOT_ID) -> int:
    """Return a number for this boot of this host, 0 where the system does not tell (not Linux)."""
    try:
        return uuid.UUID(boot_id.read_text(encoding="ascii").strip()).int >> 65  # fits an int64
    except (OSError, ValueError):
        return 0
