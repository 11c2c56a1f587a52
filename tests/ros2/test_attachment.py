"""Attachments as captured from ROS 2 Jazzy."""

import pytest

from services.ros2 import attachment
from services.ros2.attachment import Attachment

ATTACHED = bytes.fromhex("0100000000000000c41d526ef347ea18106ddcb54a141ce8bf846ab67b5087d2b9")


def test_the_captured_attachment() -> None:
    about = attachment.decode(ATTACHED)
    assert (about.sequence, about.source_ns) == (1, 0x18EA47F36E521DC4)
    assert about.gid.hex() == "6ddcb54a141ce8bf846ab67b5087d2b9"
    assert about.encode() == ATTACHED


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (b"", "an attachment has 33 bytes, not 0$"),
        (ATTACHED[:-1], "an attachment has 33 bytes, not 32$"),
        (ATTACHED + b"\0", "an attachment has 33 bytes, not 34$"),
        (ATTACHED[:16] + b"\x11" + ATTACHED[17:], "a GID has 16 bytes, not 17$"),
    ],
)
def test_other_bytes_are_no_attachment(raw: bytes, reason: str) -> None:
    with pytest.raises(ValueError, match=f"^{reason}"):
        attachment.decode(raw)


def test_an_attachment_has_33_bytes() -> None:
    assert len(Attachment(1, 2, bytes(16)).encode()) == 33
