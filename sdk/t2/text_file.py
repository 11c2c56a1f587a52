"""Files that people wrote, with whatever editor: settings, tokens, keys. Errors name the remedy."""

import codecs
import re
import unicodedata
from pathlib import Path

LARGEST = 4 * 2**20  # bytes; a settings file has some kB
UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
INSIDE = {"\0": "a NUL byte", "\ufeff": "a byte order mark inside the text"}
# What word processors and chats write for a space or a quotation mark.
TYPOGRAPHIC = re.compile(
    "[\u00a0\u00ab\u00bb\u2007\u200b\u2018-\u201e\u202f\u2060\u3000\uff02\uff07]"
)
PEM = re.compile(rb"^-----BEGIN ", re.MULTILINE)


def read_text(file: Path) -> str:
    """Return a file's text with lines that end in LF; raise ``OSError`` and ``ValueError``."""
    with file.open("rb") as stream:
        return decoded(stream.read(LARGEST + 1))


def decoded(content: bytes) -> str:
    """Decode UTF-8, or UTF-16 with a byte order mark; raise ``ValueError`` with the remedy."""
    if len(content) > LARGEST:
        raise ValueError(f"is larger than {LARGEST // 2**20} MiB: name another file")
    name, encoding = ("UTF-16",) * 2 if content.startswith(UTF16) else ("UTF-8", "utf-8-sig")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        number = content.count(b"\n", 0, error.start) + 1
        raise ValueError(f"line {number} is no {name}: save the file as UTF-8") from None
    for sign, what in INSIDE.items():
        if sign in text:
            raise ValueError(f"line {_line(text, sign)} has {what}: save the file as UTF-8")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def typographic(text: str) -> str:
    """Return where a text has a typographic space or quote, which no syntax knows; else empty."""
    if found := TYPOGRAPHIC.search(text):
        name = unicodedata.name(found[0])
        return f"line {_line(text, found[0])} has {name}: type a plain quote or space instead"
    return ""


def expanded(path: str) -> str:
    """Return a path with the home folder for ``~``; raise ``ValueError`` for an unknown user."""
    if not path.startswith("~"):
        return path
    try:
        return str(Path(path).expanduser())
    except RuntimeError:
        raise ValueError(f"{path}: no home folder is known for it; write the whole path") from None


def pem_problem(content: bytes) -> str:
    """Return why a PEM file cannot be used, with the remedy; empty without a problem."""
    if b"ENCRYPTED" in content:
        return (
            "is encrypted, and a service cannot ask for the pass phrase: write it without one, "
            "`openssl pkey -in FILE -out NEW`, readable by its owner only"
        )
    if not PEM.search(content):
        return "is no PEM file: it needs a line that begins with -----BEGIN; save it as plain ASCII"
    return ""


def _line(text: str, sign: str) -> int:
    return text.count("\n", 0, text.index(sign)) + 1
