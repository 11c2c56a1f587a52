"""Who may come in, and who may act."""

import pytest

from services.dashboard.credentials import COOKIE, Gate, new_token

OPEN, CLOSED = Gate(), Gate("a long token")
BADGE = {"cookie": f"other=1; {COOKIE}={CLOSED.badge}"}


@pytest.mark.parametrize("host", ["localhost:8080", "127.0.0.1:8080", "localhost", "[::1]:8080"])
def test_this_machine_may_come_in_without_a_token(host: str) -> None:
    assert OPEN.lets_in({"host": host})
    assert OPEN.lets_act({"host": host, "origin": f"http://{host}"})


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8080", "", "[::1", "10.7.5.9:8080"])
def test_a_name_that_somebody_else_has_bent_opens_nothing(host: str) -> None:
    assert not OPEN.lets_in({"host": host})
    assert not OPEN.lets_act({"host": host, "origin": f"http://{host}"})


def test_without_any_host_nothing_opens() -> None:
    assert not OPEN.lets_in({})


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://localhost:9999", "null", "", "localhost:8080"]
)
def test_another_page_may_look_and_not_act(origin: str) -> None:
    headers = {"host": "localhost:8080", "origin": origin}
    assert OPEN.lets_in(headers)
    assert not OPEN.lets_act(headers)
    assert not OPEN.lets_act({"host": "localhost:8080"})


def test_with_a_token_only_its_badge_opens() -> None:
    robot = {"host": "10.7.5.220:8080"}
    assert CLOSED.lets_in(robot | BADGE)
    assert CLOSED.lets_act(robot | BADGE | {"origin": "https://10.7.5.220:8080"})
    assert not CLOSED.lets_act(robot | BADGE | {"origin": "https://evil.example"})
    assert not CLOSED.lets_act(robot | {"origin": "https://10.7.5.220:8080"})


@pytest.mark.parametrize(
    "cookie", ["", f"{COOKIE}=", f"{COOKIE}=a long token", f"{COOKIE}={Gate('x').badge}", "ü=1;[]",
               f"{COOKIE}=\xff"]
)  # fmt: skip
def test_any_other_cookie_opens_nothing(cookie: str) -> None:
    assert not CLOSED.lets_in({"host": "localhost:8080", "cookie": cookie})


def test_the_token_and_nothing_else_is_the_token() -> None:
    assert CLOSED.knows("a long token")
    assert not CLOSED.knows("a long toke")
    assert not CLOSED.knows("")
    assert not CLOSED.knows("ü")


def test_the_badge_does_not_show_the_token() -> None:
    assert "a long token" not in CLOSED.badge
    assert CLOSED.badge != Gate("another").badge


def test_new_tokens_differ() -> None:
    assert len({new_token() for _ in range(20)}) == 20
