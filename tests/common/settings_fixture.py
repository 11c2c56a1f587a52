"""A place to write settings in, and to read them from."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from cli.settings import Everything
from common.config import DEFAULT_FILE, Loaded, Sources, load
from common.errors import ConfigError


class SettingsFixture:
    """A directory to write settings in, which is the working directory too."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def file(self, text: str, name: str = "over.toml") -> Path:
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return path

    def load(
        self, *texts: str, environ: dict[str, str] | None = None, sets: Sequence[str] = ()
    ) -> Loaded[Everything]:
        files = [self.file(text, f"over{number}.toml") for number, text in enumerate(texts)]
        return load(Everything, Sources((DEFAULT_FILE, *files), environ or {}, sets))

    def refused(
        self, *texts: str, environ: dict[str, str] | None = None, sets: Sequence[str] = ()
    ) -> str:
        with pytest.raises(ConfigError) as caught:
            self.load(*texts, environ=environ, sets=sets)
        return str(caught.value)
