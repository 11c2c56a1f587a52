"""The ways of counting: what each yields, what that holds for, and how it is made."""

import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from verification.cost.callgrind import under_callgrind
from verification.cost.process import Counts, replayed
from verification.cost.syscalls import system_calls


@dataclass(frozen=True, slots=True)
class Way:
    """One way of counting."""

    kinds: tuple[str, ...]  # of counts, as the ledger calls them
    holds_for: Callable[[], str]  # what must be the same for counts to be the same
    count: Callable[[], Mapping[str, Counts]]  # by kind; raises ``Uncountable``


def python() -> str:
    """Name the interpreter whose opcodes are counted."""
    return f"{platform.python_implementation()} {platform.python_version()}"


def build() -> str:
    """Name the interpreter as it was compiled, and for what."""
    return ", ".join([python(), platform.python_compiler(), platform.machine()])


WAYS = (
    Way(("opcodes",), python, lambda: {"opcodes": replayed("opcodes")}),
    Way(("instructions", "allocations"), build, under_callgrind),
    Way(("syscalls",), platform.system, lambda: {"syscalls": system_calls()}),
)
