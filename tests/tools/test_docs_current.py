"""The generated documents are current, including safety's state diagram."""

import pytest

from tools.docs import generated
from tools.safety_states import transitions

pytestmark = pytest.mark.timeout(300)


def test_the_documents_are_current() -> None:
    made = generated()
    stale = [path.name for path, text in made.items() if path.read_text(encoding="utf-8") != text]
    assert stale == [], "run `make docs` and commit the result"


def test_the_diagram_shows_what_the_policy_does() -> None:
    found = set(transitions())
    assert ("run", "bumper hit", "brake") in found
    assert ("brake", "release held", "creeping") in found
    # Only a reset or the release leaves a latched state, and nothing starts by itself.
    of_brake = {why for before, why, after in found if before == "brake"}
    assert of_brake == {"reset", "release held"}
    assert not [one for one in found if one[1] == "time" and one[2] in ("run", "slow", "creeping")]
    assert {after for before, _, after in found if before == "[*]"} == {"inhibited"}
