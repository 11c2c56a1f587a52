"""What is made from the code is as it is committed."""

from cli.docs import DOCS, generated, kinds


def test_the_documents_are_current() -> None:
    made = generated()
    stale = [path.name for path, text in made.items() if path.read_text(encoding="utf-8") != text]
    assert stale == [], "say `make docs` and commit what it writes"


def test_no_schema_is_left_over() -> None:
    names = {path.stem for path in (DOCS / "schemas").glob("*.json")}
    assert names == {kind.__name__ for kind in kinds()}


def test_every_key_and_every_field_is_there() -> None:
    page = (DOCS / "bus.md").read_text(encoding="utf-8")
    for kind in kinds():
        assert f"### {kind.__name__}\n" in page
        for name in kind.__annotations__:
            assert f"| `{name}` |" in page, f"{kind.__name__}.{name}"
