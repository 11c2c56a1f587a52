"""How old a value is, and whether that will do."""

import pytest

from common.freshness import NS_PER_S, Latest, fresh


@pytest.mark.parametrize(
    ("age_ns", "answer"),
    [
        (0, True),
        (NS_PER_S // 2, True),
        (NS_PER_S, True),
        (NS_PER_S + 1, False),
        (5 * NS_PER_S, False),
    ],
)
def test_a_value_is_fresh_up_to_its_limit(age_ns: int, answer: bool) -> None:
    latest = Latest("value", received_ns=7 * NS_PER_S)
    assert fresh(latest, 7 * NS_PER_S + age_ns, 1.0) is answer


def test_no_value_is_never_fresh() -> None:
    assert not fresh(None, 0, 1e9)


def test_age_is_in_seconds() -> None:
    assert Latest(1, received_ns=NS_PER_S).age_s(NS_PER_S + NS_PER_S // 4) == 0.25
