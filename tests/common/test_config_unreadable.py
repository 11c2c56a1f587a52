"""Unreadable settings files: invalid TOML, binary data, too deep, too long."""

from pathlib import Path

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from common.settings import Shared
from tests.common.settings_fixture import SettingsFixture


@pytest.mark.parametrize("text", ["a = ", "\x00", "a = " + "[" * 3000, "[board]\n[board]"])
def test_what_is_no_toml_is_refused(settings_dir: SettingsFixture, text: str) -> None:
    assert "over0.toml: is no TOML: " in settings_dir.refused(text)


DEEP = ".".join("a" * 3000)
MANY_DIGITS = "1" * 5000  # more than Python reads


def test_a_file_of_too_many_digits_or_tables_is_refused(settings_dir: SettingsFixture) -> None:
    assert "over0.toml: is no TOML: " in settings_dir.refused(f"[board]\nport = {MANY_DIGITS}")
    assert settings_dir.refused(f"[board]\n{DEEP} = 1") == "over0.toml: tables are nested too deep"


@pytest.mark.parametrize("value", [MANY_DIGITS, "[" * 3000])
def test_what_cannot_be_read_as_a_value_is_text(settings_dir: SettingsFixture, value: str) -> None:
    for said in (
        settings_dir.refused(sets=[f"board.port={value}"]),
        settings_dir.refused(environ={"T2__BOARD__PORT": value}),
    ):
        assert f"board.port = '{value}': Expected `int`, got `str`" in said


def test_a_set_of_too_many_tables_is_refused(settings_dir: SettingsFixture) -> None:
    assert settings_dir.refused(sets=[f"board={{{DEEP} = 1}}"]).endswith(
        ": tables are nested too deep"
    )


@pytest.mark.parametrize(
    ("sets", "environ", "sentence"),
    [
        (["board.\udc98=1"], {}, "--set board.\\udc98=1: is no UTF-8"),
        (["robot.id=\udcff"], {}, "--set robot.id=\\udcff: is no UTF-8"),
        ([], {"T2__BOARD__\udc80": "1"}, "environment T2__BOARD__\\udc80: is no UTF-8"),
        ([], {"T2__ROBOT__ID": "\udc80"}, "environment T2__ROBOT__ID: is no UTF-8"),
    ],
)
def test_bytes_that_are_no_text_are_refused(
    settings_dir: SettingsFixture, sets: list[str], environ: dict[str, str], sentence: str
) -> None:
    assert settings_dir.refused(sets=sets, environ=environ) == sentence


def test_a_field_that_looks_like_a_path_is_refused(settings_dir: SettingsFixture) -> None:
    assert "board.x` - at `$: unknown; there are" in settings_dir.refused(
        "[board]\n'x` - at `$' = 1"
    )


def test_what_is_no_text_is_refused(settings_dir: SettingsFixture) -> None:
    (settings_dir.folder / "raw.toml").write_bytes(b"a = '\xff'")
    with pytest.raises(ConfigError, match=r"raw\.toml: is no TOML: "):
        load(Shared, Sources((Path("raw.toml"),), {}))


def test_what_cannot_be_read_is_refused(settings_dir: SettingsFixture) -> None:
    with pytest.raises(ConfigError, match=r"^none\.toml: cannot be read: No such file"):
        load(Shared, Sources((Path("none.toml"),), {}))
    with pytest.raises(ConfigError, match="cannot be read: Is a directory"):
        load(Shared, Sources((settings_dir.folder,), {}))
