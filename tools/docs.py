"""``make docs``: write the generated tables of the documents, and the JSON schemas.

With ``--check`` (in ``make lint``) it compares them with the committed files instead. The tables
stand between ``<!-- name -->`` and ``<!-- end -->``; the text around them is written by hand.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec import Struct

from services.metrics.samples import METRICS
from services.safety.core.causes import RULES, Clears
from t2 import keys
from t2 import messages as m
from t2.catalogue import CAUSES, EVENTS
from tools import rights_table, settings_file
from tools.fields import fields_of
from verification.harness.results import filled, table

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
CLEARED = {
    Clears.RESET: "reset",
    Clears.SETTLED: "by itself after 0.5 s, then a neutral request",
    Clears.NEUTRAL: "by itself, then a neutral request",
    Clears.AT_ONCE: "by itself",
}


def main(arguments: Sequence[str]) -> int:
    """Write every generated file, or return 1 when one is not current."""
    checks = "--check" in arguments
    stale = {path: text for path, text in generated().items() if current(path) != text}
    for path, text in stale.items():
        if checks:
            print(f"{path.relative_to(ROOT)} is not current; run `make docs`")
        else:
            path.write_text(text, encoding="utf-8")
    return int(checks and bool(stale))


def current(path: Path) -> str:
    """Return the committed text of a generated file; empty when there is none."""
    return path.read_text(encoding="utf-8") if path.exists() else ""


def generated() -> dict[Path, str]:
    """Return the text of each generated file."""
    bus = {"topics": topics(), "calls": calls(), "classes": classes(), "fields": fields()}
    blocks = {
        "bus": bus,
        "safety": {"causes": causes()},
        "security": {"rights": rights_table.table()},
        "operations": {"metrics": metrics(), "events": events()},
    }
    pages = {DOCS / f"{name}.md": tables for name, tables in blocks.items()}
    schemas = {DOCS / "schemas" / f"{kind.__name__}.json": schema(kind) for kind in kinds()}
    filled_pages = {page: filled(current(page), tables) for page, tables in pages.items()}
    settings = {ROOT / "config" / "t2.toml": settings_file.text()}
    return filled_pages | schemas | settings


def kinds() -> list[type[Struct]]:
    """Return every struct of the interface: messages, then requests and replies."""
    of_topics = [topic.message for topic in keys.TOPICS]
    of_calls = [kind for call in keys.CALLS for kind in (call.request, call.reply)]
    parts: list[type[Struct]] = [m.Relay, m.Cause, m.Limits, m.Release, m.Durations, m.Setting]
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


def fields() -> str:
    """Return the table of all structs and their fields with units, from their source."""
    rows: list[tuple[str, str, str, str]] = []
    for kind in kinds():
        anchor = f'<a id="{kind.__name__.lower()}"></a>'
        rows.append((f"{anchor}**{kind.__name__}**", "", "", (kind.__doc__ or "").splitlines()[0]))
        rows.extend(
            (f"`{name}`", f"`{type_}`".replace("|", "\\|"), f"`{default}`" if default else "", why)
            for name, type_, default, why in fields_of(kind)
        )
    return table(("field", "type", "default", ""), rows)


def causes() -> str:
    """Return the table of safety's causes, most severe first."""
    rows = [
        (f"`{rule.name}`", rule.action.upper(), "yes" if rule.clears is Clears.RESET else "no",
         CLEARED[rule.clears], CAUSES[rule.name].text[0])
        for rule in RULES
    ]  # fmt: skip
    return table(("cause", "action", "latched", "clears", "in words"), rows)


def events() -> str:
    """Return the table of events."""
    rows = [
        (row.services, f"`{row.name}`", row.levels, row.text[0], row.remedy[0]) for row in EVENTS
    ]
    return table(("service", "event", "level", "text", "what to do"), rows)


def metrics() -> str:
    """Return the table of Prometheus metrics."""
    return table(("metric", ""), [(f"`{name}`", about) for name, about in METRICS.items()])


def _link(kind: type[Struct]) -> str:
    return f"[{kind.__name__}](#{kind.__name__.lower()})"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
