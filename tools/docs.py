"""``make docs``: write the generated tables of the documents, and the JSON schemas.

A test compares the output with the committed files. The tables stand between ``<!-- name -->`` and
``<!-- end -->``; the text around them is written by hand.
"""

import json
import sys
from pathlib import Path

import msgspec
from msgspec import Struct

from cli.inspect.schema import fields_of
from common import codec, keys
from common import messages as m
from services.metrics.samples import FAMILIES
from tools import rights_table, safety_states, sdk
from verification.harness.results import filled, table

DOCS = Path(__file__).parent.parent / "docs"


def main() -> int:
    """Write every generated file."""
    for path, text in generated().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return 0


def generated() -> dict[Path, str]:
    """Return the text of each generated file."""
    schemas = {DOCS / "schemas" / f"{kind.__name__}.json": schema(kind) for kind in kinds()}
    bus = {
        "topics": topics(),
        "calls": calls(),
        "classes": classes(),
        "fields": "\n".join(fields(kind) for kind in kinds()),
    }
    safety = {"states": safety_states.diagram(), "causes": causes()}
    security = {"rights": rights_table.table()}
    pages = {
        DOCS / "bus.md": bus,
        DOCS / "safety.md": safety,
        DOCS / "security.md": security,
        DOCS / "operations.md": {"metrics": metrics()},
        DOCS / "integrate.md": {f"rust_{name}": rust(name) for name in ("read", "drive", "limit")},
    }
    return (
        {page: filled(page.read_text(encoding="utf-8"), blocks) for page, blocks in pages.items()}
        | schemas
        | sdk.generated()
    )


def kinds() -> list[type[Struct]]:
    """Return every struct of the interface: messages, then requests and replies."""
    of_topics = [topic.message for topic in keys.TOPICS]
    of_calls = [kind for call in keys.CALLS for kind in (call.request, call.reply)]
    parts: list[type[Struct]] = [m.Relay, m.Cause, m.Limits, m.Release, m.Timing, m.Durations]
    return list(dict.fromkeys([m.Message, *of_topics, *parts, *of_calls]))


def schema(kind: type[Struct]) -> str:
    """Return the JSON schema of a struct."""
    return json.dumps(msgspec.json.schema(kind), indent=2, ensure_ascii=False) + "\n"


def topics() -> str:
    """Return the table of topics."""
    rows = [
        (f"`{topic.path}`", f"[{topic.message.__name__}](#{topic.message.__name__.lower()})",
         f"{topic.rate_hz:g}" if topic.rate_hz else "on change",
         topic.service.name, topic.publisher, topic.what)
        for topic in keys.TOPICS
    ]  # fmt: skip
    estop = (f"`{keys.ESTOP_PATH}`", "anything", "on change", "estop", "anybody",
             "any PUT or DELETE stops the robot and latches")  # fmt: skip
    return table(("key", "message", "Hz", "class", "publisher", "carries"), [*rows, estop])


def calls() -> str:
    """Return the table of calls."""
    rows = [
        (f"`{call.path}`", _link(call.request), _link(call.reply), call.server, call.what)
        for call in keys.CALLS
    ]
    return table(("key", "request", "reply", "server", "does"), rows)


def classes() -> str:
    """Return the table of the classes of service."""
    services = dict.fromkeys([keys.ESTOP_CLASS, *(topic.service for topic in keys.TOPICS)])
    rows = [
        (s.name, s.priority, "yes" if s.express else "no", str(s.history or "-"), s.reason)
        for s in services
    ]
    return table(("class", "priority", "express", "history", "because"), rows)


def fields(kind: type[Struct]) -> str:
    """Return the table of a struct's fields with units, from its source."""
    cells = [
        (f"`{name}`", f"`{type_}`".replace("|", "\\|"), f"`{default}`" if default else "", why)
        for name, type_, default, why in fields_of(kind)
    ]
    summary = (kind.__doc__ or "").splitlines()[0]
    carried = f" Encoding `{codec.encoding(kind)}`." if kind is not m.Message else ""
    head = f"### {kind.__name__}\n\n{summary}{carried}\n"
    return head + (f"\n{table(('field', 'type', 'default', ''), cells)}\n" if cells else "")


def causes() -> str:
    """Return the table of safety's causes."""
    return table(("cause", "action", "latched", "clears", "in words"), safety_states.causes())


def metrics() -> str:
    """Return the table of Prometheus metrics."""
    rows = [
        (f"`{one.name}`", one.kind, ", ".join(f"`{label}`" for label in one.labels), one.help)
        for one in FAMILIES
    ]
    return table(("metric", "kind", "labels", ""), rows)


def rust(name: str) -> str:
    """Return a program of the Rust example as a fenced block."""
    file = DOCS.parent / "examples" / "rust" / "src" / "bin" / f"{name}.rs"
    return f"```rust\n{file.read_text(encoding='utf-8')}```"


def _link(kind: type[Struct]) -> str:
    return f"[{kind.__name__}](#{kind.__name__.lower()})"


if __name__ == "__main__":
    sys.exit(main())
