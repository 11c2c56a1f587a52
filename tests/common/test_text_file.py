"""Files as the editors of other people save them."""

from pathlib import Path

import pytest

from t2.text_file import LARGEST, decoded, expanded, pem_problem, read_text, typographic


@pytest.mark.parametrize(
    "content",
    [b"a\nb\n", b"a\r\nb\r\n", b"a\rb\r", b"\xef\xbb\xbfa\nb\n", b"\xff\xfea\0\n\0b\0\n\0",
     b"\xfe\xff\0a\0\r\0\n\0b\0\n"],
)  # fmt: skip
def test_the_same_text_in_each_form(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(content)
    assert read_text(tmp_path / "file") == "a\nb\n"


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"a\nd\xfcse", "line 2 is no UTF-8: save the file as UTF-8"),  # Latin-1
        (b"\xff\xfea", "line 1 is no UTF-16"),  # cut off
        (b"a\0\n\0", "line 1 has a NUL byte"),  # UTF-16 without its mark
        (b"\xff\xfe\0\0a\0\0\0", "line 1 has a NUL byte"),  # UTF-32
        (b"a\n\xef\xbb\xbfb", "line 2 has a byte order mark inside the text"),  # two files joined
        (bytes(LARGEST + 1), "is larger than 4 MiB"),
    ],
)
def test_what_is_ambiguous_is_refused(content: bytes, problem: str) -> None:
    with pytest.raises(ValueError, match=f"^{problem}"):
        decoded(content)


def test_a_folder_and_an_endless_file(tmp_path: Path) -> None:
    with pytest.raises(IsADirectoryError):
        read_text(tmp_path)
    with pytest.raises(ValueError, match="is larger"):
        read_text(Path("/dev/zero"))
    assert read_text(Path("/dev/null")) == ""


def test_home_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/ada")
    assert expanded("~/keys") == "/home/ada/keys"
    assert expanded("keys/~") == "keys/~"
    with pytest.raises(ValueError, match=r"^~nobody-here/x: no home folder is known"):
        expanded("~nobody-here/x")


def test_typographic_signs_are_named() -> None:
    assert typographic('a = "b"\n') == ""
    text = "a = 1\nb = \u201cc\u201d\n"
    assert typographic(text).startswith("line 2 has LEFT DOUBLE QUOTATION MARK: type a plain")


def test_pem_files() -> None:
    assert pem_problem(b"a comment\n-----BEGIN PRIVATE KEY-----\n") == ""
    for head in (b"-----BEGIN ENCRYPTED PRIVATE KEY-----\n", b"Proc-Type: 4,ENCRYPTED\n"):
        assert "openssl pkey" in pem_problem(b"-----BEGIN X-----\n" + head)
    for content in (b"", b"\xef\xbb\xbf-----BEGIN X-----", "-----BEGIN".encode("utf-16"), b"0\x82"):
        assert pem_problem(content).startswith("is no PEM file")
