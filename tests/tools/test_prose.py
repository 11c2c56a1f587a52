"""The vocabulary check: what it reads, what it masks, and that the tree passes it."""

from pathlib import Path

import pytest

from tools import prose
from tools.prose import NAMES, RULES, Finding, Rule

STALL = Rule(r"\bhold up\b", "stall")
OPENING = Rule(prose.DOCSTRING + r"(?:Tell|Say)\b", "Report")


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    return tmp_path


def found(
    root: Path, name: str, text: str, *rules: Rule, names: tuple[Rule, ...] = ()
) -> list[str]:
    (root / name).write_text(text, encoding="utf-8")
    return [str(finding) for finding in prose.check(name, rules, names)]


def test_a_finding_is_one_line() -> None:
    assert str(Finding("a.py", 3, "hold up", "stall")) == "a.py:3: hold up -> stall"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('"""They hold up."""\n', 1),
        ('\n"""\nThey hold\nup.\n"""\n', 3),
        ("x = 1  # they hold up\n", 1),
        ("# they hold\n# up\n", 1),
        ("log('they hold up')\n", 1),
        ("log(f'{x} hold up')\n", 1),
    ],
)
def test_docstrings_comments_and_strings_are_read(root: Path, text: str, line: int) -> None:
    assert found(root, "a.py", text, STALL) == [f"a.py:{line}: hold up -> stall"]


@pytest.mark.parametrize("text", ["hold = up\n", "hold; up\n", "f('hold', 'up')\n"])
def test_code_is_no_prose(root: Path, text: str) -> None:
    assert found(root, "a.py", text, STALL) == []


def test_the_first_word_of_a_docstring(root: Path) -> None:
    assert found(root, "a.py", '"""Tell it."""\n', OPENING) == ["a.py:1: Tell -> Report"]
    assert found(root, "a.py", "'Tell it.'\n", OPENING) == []
    assert found(root, "a.py", '"""Never tell: Tell."""\n', OPENING) == []


def test_markdown_without_its_code(root: Path) -> None:
    text = "They hold\nup.\n\n`hold up`\n\n```sh\nhold up\n```\n\nhold up\n"
    assert found(root, "a.md", text, STALL) == [
        "a.md:1: hold up -> stall", "a.md:10: hold up -> stall"
    ]  # fmt: skip


def test_generated_blocks_are_checked_in_the_code_that_makes_them(root: Path) -> None:
    text = "<!-- {} -->\nhold up\n<!-- end -->\n"
    assert found(root, "a.md", text.format("metrics"), STALL) == []
    assert found(root, "a.md", text.format("events"), STALL) == ["a.md:2: hold up -> stall"]


def test_the_texts_of_a_catalogue(root: Path) -> None:
    assert found(root, "texts.toml", 'a = ["hold up"]\n', STALL) == [
        "texts.toml:1: hold up -> stall"
    ]


def test_comments_of_other_files(root: Path) -> None:
    text = "hold up = 1 # they hold up\n"
    assert found(root, "a.toml", text, STALL) == ["a.toml:1: hold up -> stall"]
    assert found(root, "Makefile", "x: y ## they hold up\n", STALL) != []
    assert found(root, "a.svg", "# they hold up\n", STALL) == []


def test_names_of_files_and_identifiers_as_a_whole(root: Path) -> None:
    names = (Rule("heir", "child"),)
    assert found(root, "heir.py", "their = 1\n", names=names) == ["heir.py:1: heir -> child"]
    assert found(root, "a.py", "\nheir = 'heir'\n", names=names) == ["a.py:2: heir -> child"]


@pytest.mark.parametrize(
    "phrase",
    [
        "every so manieth", "the settings in force", "how the services fare", "on the road",
        "a number that is none.", "nobody's bus", "it holds processes up", "once it is mended",
        "in each weather", "the last word", "nearer to the wheels", "who dials",
    ],
)  # fmt: skip
def test_banned_phrases(root: Path, phrase: str) -> None:
    assert found(root, "a.md", phrase, *RULES) != []


@pytest.mark.parametrize(
    "phrase",
    [
        "Received messages.", "It returns none of them.", "The hold time is up to 3 s.",
        "Set the priority.", "A broad field.", "Print messages received on a key.",
    ],
)  # fmt: skip
def test_no_false_alarm(root: Path, phrase: str) -> None:
    assert found(root, "a.md", phrase, *RULES) == []


def test_a_phrase_of_an_interface_is_allowed_in_its_files(root: Path) -> None:
    names = (Rule("tell", "report"),)
    (root / "services" / "recorder").mkdir(parents=True)
    assert found(root, "services/recorder/a.py", "f.tell()\n", names=names) == []
    assert found(root, "a.py", "f.tell()\n", names=names) == ["a.py:1: tell -> report"]


def test_every_rule_suggests_something_else() -> None:
    for rule in (*RULES, *NAMES):
        assert rule.suggestion


def test_a_finding_fails_the_run(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (root / "a.md").write_text("It holds processes up.\n", encoding="utf-8")
    assert prose.main(["a.md"]) == 1
    assert capsys.readouterr().out.startswith("a.md:1: holds processes up -> ")
    (root / "a.md").write_text("It stalls.\n", encoding="utf-8")
    assert prose.main(["a.md"]) == 0
    assert capsys.readouterr().out == ""
