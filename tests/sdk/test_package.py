"""The client library stands alone: Python 3.10, Zenoh and msgspec, and nothing of the stack."""

import ast
import pickle
import sys
from collections.abc import Iterator

import msgspec
import pytest

import t2
from common import cli_args
from services.relay import core as relay
from t2 import messages
from t2.messages import Cause, Event
from tools.docs import ROOT


def imported(tree: ast.Module) -> Iterator[str]:
    """Yield the names of the imported packages."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield str(node.module).partition(".")[0]


def test_it_is_python_3_10_and_imports_nothing_of_the_stack() -> None:
    allowed = {*sys.stdlib_module_names, "msgspec", "t2", "zenoh", "pytest", "mcap"}
    for file in (ROOT / "sdk" / "t2").glob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"), feature_version=(3, 10))
        assert set(imported(tree)) <= allowed, file


CAUSE = Cause(name="estop", action="brake", age=0.0, text="Emergency stop.")


BLOCKED = t2.Blocked("blocked", [CAUSE])
BLOCKED.left, BLOCKED.unit = 0.5, "rad"


@pytest.mark.parametrize(
    "error", [BLOCKED, t2.Overruled("teleop"), t2.Latched("latched", [CAUSE]), t2.NoData("no data")]
)
def test_an_error_survives_pickling(error: t2.T2Error) -> None:
    loaded = pickle.loads(pickle.dumps(error))
    assert (type(loaded), str(loaded), vars(loaded)) == (type(error), str(error), vars(error))
    assert not isinstance(error, TimeoutError)


def test_it_shows_its_public_names_only() -> None:
    assert set(dir(t2)) == {*t2.__all__, "__version__", "messages"}
    assert all(hasattr(t2, name) for name in dir(t2))


def test_one_version_is_everywhere() -> None:
    assert t2.__version__ == cli_args.VERSION == relay.VERSION == messages.VERSION
    for project in (ROOT, ROOT / "sdk"):
        text = (project / "pyproject.toml").read_text("utf-8")
        assert 'dynamic = ["version"]' in text
        assert 'messages.py"\n' in text.partition("[tool.hatch.version]")[2]
    assert f'"t2-sdk=={messages.VERSION}"' in (ROOT / "pyproject.toml").read_text("utf-8")


def test_a_message_with_a_name_of_a_later_version_is_decoded() -> None:
    event = {"name": "of_2030", "level": "info", "text": ""}
    assert msgspec.convert(event, Event).name == "of_2030"  # type: ignore[comparison-overlap]
    cause = {"name": "of_2030", "action": "stop", "age": 0, "text": ""}
    assert msgspec.convert(cause, Cause).name == "of_2030"  # type: ignore[comparison-overlap]
