"""How old a value is, and whether that will do."""

import pytest

from common.freshness import Latest, S, fresh


@pytest.mark.parametrize(
    ("age_ns", "answer"),
    [(0, True), (S // 2, True), (S, True), (S + 1, False), (5 * S, False)],
)
def test_a_value_is_fresh_up_to_its_limit(age_ns: int, answer: bool) -> None:
    latest = Latest("value", received_ns=7 * S)
    assert fresh(latest, 7 * S + age_ns, 1.0) is answer


def test_no_value_is_never_fresh() -> None:
    assert not fresh(None, 0, 1e9)


def test_age_is_in_seconds() -> None:
    assert Latest(1, received_ns=S).age_s(S + S // 4) == 0.25
