"""Vocabulary check: report phrases that the project's style guide replaces.

``make lint`` runs it over every tracked file. It reads docstrings, comments and strings of Python,
the prose of Markdown, comments of configuration files, Python identifiers and file names.
Each finding is one line: ``file:line: phrase -> suggestion``.

Code is masked before the search, so patterns see prose only and may span lines. Fenced blocks and
`code spans` of Markdown are masked, too: quote an event or a setting in backticks.
"""

import argparse
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
CODE = "\0"  # replaces each character that is not prose
DOCSTRING = "\2"  # marks the start of a triple-quoted string

# These files quote the phrases, or are written by a campaign that takes hours.
EXCLUDED = {
    "tools/prose.py", "tests/tools/test_prose.py",
    "docs/faults.md", "docs/performance.md", "docs/roaming.md", "bench/page.md",
    "verification/roaming/page.md",
}  # fmt: skip
COMMENTED = {".toml", ".yaml", ".yml", ".sh", ".nft", ".service", ".conf", ".env"}
COMMENTED_NAMES = {"Makefile", "Dockerfile"}
CATALOGUES = {"texts.toml", "families.toml"}  # their strings are prose, too
HASH_COMMENT = re.compile(r"(?:^|(?<=\s))#+(?=\s)[^\n]*", re.MULTILINE)
# Code, and blocks that are generated from code; `events` is written by hand.
MARKDOWN_CODE = re.compile(
    r"^ *```.*?^ *```$|``.+?``|`[^`\n]*`|<!-- (?!events)\w+ -->.*?<!-- end -->",
    re.MULTILINE | re.DOTALL,
)


class Rule(NamedTuple):
    """A pattern to avoid, and what to write instead."""

    pattern: str
    suggestion: str


class Finding(NamedTuple):
    """One match of a rule."""

    file: str
    line: int
    phrase: str
    suggestion: str

    def __str__(self) -> str:
        """Return the line that is printed."""
        return f"{self.file}:{self.line}: {self.phrase} -> {self.suggestion}"


class Interface(NamedTuple):
    """A phrase that some files must contain: the name is not ours, or is recorded elsewhere."""

    phrase: str
    files: tuple[str, ...]  # paths, or folders with a slash at their end
    reason: str


# A space in a pattern matches any white space, line breaks of a comment included.
RULES = (
    Rule(r"\bBREAKs?\b", "BRAKE: the manual's spelling stays in common/wire"),
    Rule(r"\b(?:stands?|standing) beside\b", "is next to, is added to"),
    Rule(r"\broads?\b", "path"),
    Rule(r"\b(?:is|are|was) had (?:from|where|by)\b|\bhad where\b", "installed from, available"),
    Rule(r"\bno good\b", "invalid"),
    Rule(r"\bso manieth\b", "every n-th"),
    Rule(r"\bowned? up to\b", "named in `unsafe_overrides`"),
    Rule(r"\bnobody's\b", "name the owner, or 'unowned'"),
    Rule(r"\bfar(?:es?|ing)\b", "health, status"),
    Rule(r"\bh(?:o|e)lds? processes up\b|\bhold-ups?\b", "scheduling stall"),
    Rule(r"\bh(?:e|o)ld(?:s|ing)? (?:it |them |others? |\w+body )?up\b", "stall, delay, block"),
    Rule(r"\bmend(?:s|ed|ing)?\b", "fix"),
    Rule(r"\bweather\b", "link conditions"),
    Rule(r"\blives? with\b", "tolerates, accepts"),
    Rule(r"\bin force\b", "effective"),
    Rule(r"\bthat is none\b|\bis none(?=[.,;:)])", "name the property: non-finite, invalid"),
    Rule(r"\blast words?\b", "final output, action on exit"),
    Rule(r"\b(?:before|near(?:er)? to) the wheels\b", "closer to the actuators"),
    Rule(r"\b(?:stands?|is) in (?:its|the|their) way\b", "barrier, prevents"),
    Rule(r"\bfor ever\b", "indefinitely"),
    Rule(r"\bon (?:its|the|their) way out\b", "on exit"),
    Rule(r"\bwhat (?:it|T2|a \w+) stands on\b", "dependencies"),
    Rule(r"\b(?:says|tells|told) (?:so|who|of|how|that|why|whether|what)\b", "reports, states"),
    Rule(r"\b(?:is|are|was|were|be|been|not) (?:heard|told|asked for)\b", "received, reported"),
    Rule(r"\bhears? (?:of|from|the|nothing|that)\b", "receives"),
    Rule(r"\b(?:begins?|began|begun|starts?|started|made|make|makes) anew\b", "restart, renew"),
    Rule(r"\b(?:whoever|who(?:se)? (?:dials|stands|asks|is near))\b", "name the role: the client"),
    Rule(r"\b(?:dials?|dialled)\b", "connects to"),
    Rule(r"\bunless told\b", "by default"),
    Rule(r"\b(?:thinned|thinning)\b", "downsampled"),
    Rule(DOCSTRING + r"(?:Tell|Say|Hear|Let|Mend)\b", "Report, Log, Return, Read, Allow"),
)  # fmt: skip

# Identifiers and the stems of file names, matched as a whole.
NAMES = (
    Rule(r"i_accept", "unsafe_overrides"),
    Rule(r"last_words", "on_exit"),
    Rule(r"holdup|hold_up", "host_stalls"),
    Rule(r"heir", "child"),
    Rule(r"run_behind", "run_optional_service"),
    Rule(r"[Rr]oster", "members"),
    Rule(r"enclosure", "namespaces"),
    Rule(r"at_rest", "is_stopped"),
    Rule(r"[Ss]eat(?:ed)?", "BusSession, open_session"),
    Rule(r"[Cc]lockwork", "simulated_stack"),
    Rule(r"ears?|Ears?|[Hh]eard", "sonar_array, LatestTopic, received"),
    Rule(r"logbook", "event_log"),
    Rule(r"desk|Desk", "controller"),
    Rule(r"life", "__main__"),
    Rule(r"deeds|breakages|troubles", "injectors, mutations, fault_rules"),
    Rule(r"Lane|lane|[Rr]ig|[Ss]cene|Stage|stage", "stack_fixture, *_fixture"),
    Rule(r"handover|guarded", "guard_ipc, child"),
    Rule(r"[Ss]helf|[Tt]ape", "storage, rolling_writer"),
    Rule(r"[Bb]eliefs?", "PoseEstimate, accepts"),
    Rule(r"[Gg]rip|[Dd]oor", "driver_lock, auth"),
    Rule(r"legs?", "arc_segments"),
    Rule(r"meters", "stream_stats"),
    Rule(r"quietly", "until_interrupt"),
    Rule(r"thinning", "downsampling"),
    Rule(r"[Aa]sk|[Ww]ish", "DriveRequest, requested twist"),
    Rule(r"mend(?:ed)?|tells?|told|somebody|nobody|anybody|everybody", "fix, report, or the role"),
)  # fmt: skip


INTERFACES = (
    Interface("tell", ("services/recorder/",), "method of Python's files"),
    Interface(
        "begun anew", ("verification/soak/", "tests/verification/soak/"), "event in recorded logs"
    ),
    Interface(
        "not heard",
        ("verification/faults/catalogue.py", "tests/verification/faults/test_campaign.py"),
        "name of a fault in docs/faults.md",
    ),
    Interface(
        "BREAK",
        (
            "common/wire/",
            "tests/common/wire/",
            "docs/adr/",
            "docs/checkout.md",
            "docs/safety.md",
            "services/bridge/README.md",
            "CHANGELOG.md",
        ),
        "the manual's spelling, where it is explained or quoted",
    ),
    Interface("thinned", ("verification/roaming/conditions.py",), "name in docs/roaming.md"),
)


def main(words: Sequence[str] | None = None) -> int:
    """Check the tracked files, or those named; 0: no finding, 1: findings."""
    parser = argparse.ArgumentParser(prog="python -m tools.prose", description=__doc__)
    parser.add_argument("files", nargs="*", help="paths from the root; default: all tracked files")
    args = parser.parse_args(words)
    found = [finding for file in args.files or tracked() for finding in check(file, RULES, NAMES)]
    for finding in found:
        print(finding)
    return 1 if found else 0


def tracked() -> list[str]:
    """Return the paths of all tracked files that exist."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return [file for file in listed.stdout.split("\0") if file and (ROOT / file).is_file()]


def check(file: str, rules: Iterable[Rule], names: Iterable[Rule]) -> Iterator[Finding]:
    """Yield the findings of one file, those of its name first."""
    if file in EXCLUDED:
        return
    path = ROOT / file
    text = path.read_text(encoding="utf-8") if _is_read(path) else ""
    found = [*_names([(1, path.stem)], file, names), *find(prose(path, text), file, rules)]
    if path.suffix == ".py":
        found += _names(identifiers(text), file, names)
    yield from (finding for finding in found if not is_interface(finding))


def is_interface(finding: Finding) -> bool:
    """Return whether a finding is an exception of ``INTERFACES``."""
    return any(
        finding.phrase == one.phrase and finding.file.startswith(one.files) for one in INTERFACES
    )


def find(text: str, file: str, rules: Iterable[Rule]) -> Iterator[Finding]:
    """Yield the matches of rules in masked text."""
    for rule in rules:
        for match in re.finditer(rule.pattern.replace(" ", r"\s+"), text):
            line = text.count("\n", 0, match.start()) + 1
            phrase = " ".join(match[0].strip(DOCSTRING).split())
            yield Finding(file, line, phrase, rule.suggestion)


def prose(path: Path, text: str) -> str:
    """Return the text with everything masked that is not prose, line breaks kept."""
    if path.suffix == ".py":
        return _python(text)
    if path.name in CATALOGUES:
        return text
    if path.suffix == ".md":
        return MARKDOWN_CODE.sub(lambda match: _masked(match[0]), text)
    return _kept(text, [match.span() for match in HASH_COMMENT.finditer(text)])


def identifiers(text: str) -> Iterator[tuple[int, str]]:
    """Yield line and name of each identifier of a Python source."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NAME:
            yield token.start[0], token.string


def _is_read(path: Path) -> bool:
    suffixes = COMMENTED | {".py", ".md"}
    return path.suffix in suffixes or path.name in COMMENTED_NAMES


def _python(text: str) -> str:
    """Keep comments and strings; f-strings are one token up to Python 3.11, parts from 3.12 on."""
    kinds = {tokenize.COMMENT, tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", -1)}
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    spans, docstrings = [], []
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in kinds:
            begin, end = (starts[row - 1] + column for row, column in (token.start, token.end))
            quotes = re.match(r"\w*(\"\"\"|'''|[\"'])", text[begin:end])
            skipped = quotes.end() if quotes and token.type == tokenize.STRING else 0
            spans.append((begin + skipped, end))
            if skipped and len(quotes[1]) == 3:  # type: ignore[index]
                docstrings.append(begin + skipped - 1)
    masked = list(_kept(text, spans))
    for position in docstrings:
        masked[position] = DOCSTRING
    # The sign of a comment must not part two of its lines.
    return "".join(masked).replace("#", " ")


def _kept(text: str, spans: Iterable[tuple[int, int]]) -> str:
    """Mask everything outside the spans."""
    parts, position = [], 0
    for begin, end in spans:
        parts += [_masked(text[position:begin]), text[begin:end]]
        position = end
    return "".join([*parts, _masked(text[position:])])


def _masked(text: str) -> str:
    return re.sub(r"\S", CODE, text)


def _names(named: Iterable[tuple[int, str]], file: str, rules: Iterable[Rule]) -> Iterator[Finding]:
    """Yield each identifier that a rule matches as a whole, once for each line."""
    rules = list(rules)
    for line, name in dict.fromkeys(named):
        for rule in rules:
            if re.fullmatch(rule.pattern, name):
                yield Finding(file, line, name, rule.suggestion)


if __name__ == "__main__":
    sys.exit(main())
