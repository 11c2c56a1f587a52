"""What the system tests need of the host."""

import os
import shutil

import pytest

from verification.system import frame


def test_a_missing_program_is_named_by_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(shutil, "which", lambda tool: None if tool == "debootstrap" else tool)
    assert frame.lacking() == "a program is missing: apt install debootstrap"
