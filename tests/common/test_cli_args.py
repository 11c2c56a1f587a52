"""Language of the reader, from the environment."""

import pytest

from common.cli_args import reader_language
from common.errors import ConfigError


@pytest.mark.parametrize(
    ("environ", "language"),
    [
        ({}, "en"),
        ({"T2_LANG": "zh", "LANG": "de_DE.UTF-8"}, "zh"),
        ({"T2_LANG": "en", "LC_ALL": "zh_CN.UTF-8"}, "en"),
        ({"T2_LANG": "", "LANG": "zh_TW.UTF-8"}, "zh"),
        ({"LC_ALL": "C", "LANG": "zh_CN.UTF-8"}, "en"),  # LC_ALL counts first
        ({"LC_ALL": "", "LC_MESSAGES": "zh_CN", "LANG": "C"}, "zh"),
    ],
)
def test_language_of_the_reader(environ: dict[str, str], language: str) -> None:
    assert reader_language(environ) == language


def test_another_language_is_refused() -> None:
    with pytest.raises(ConfigError, match="environment T2_LANG: 'fr' is unknown; use en or zh"):
        reader_language({"T2_LANG": "fr"})
