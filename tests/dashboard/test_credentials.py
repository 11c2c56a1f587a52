"""Credentials: which requests may view and which may act."""

import pytest

from services.dashboard.credentials import COOKIE, Credentials

LOCAL, WITH_TOKEN = Credentials(), Credentials("a long token")
COOKIE_HEADER = {"cookie": f"other=1; {COOKIE}={WITH_TOKEN.cookie}"}


@pytest.mark.parametrize(
    ("host", "is_local"),
    [
        ("localhost:8080", True),
        ("127.0.0.1", True),
        ("[::1]:8080", True),
        ("evil.example:8080", False),
        ("10.7.5.9:8080", False),
        ("[::1", False),
        ("", False),
    ],
)
def test_without_a_token_the_host_must_be_this_one(host: str, is_local: bool) -> None:
    assert LOCAL.may_view({"host": host}) is is_local
    assert LOCAL.may_act({"host": host, "origin": f"http://{host}"}) is is_local


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://localhost:9999", "null", "", "localhost:8080"]
)
def test_another_origin_may_view_but_not_act(origin: str) -> None:
    headers = {"host": "localhost:8080", "origin": origin}
    assert LOCAL.may_view(headers)
    assert not LOCAL.may_act(headers)
    assert not LOCAL.may_act({"host": "localhost:8080"})


def test_with_a_token_only_its_cookie_is_accepted() -> None:
    robot = {"host": "10.7.5.220:8080"}
    assert WITH_TOKEN.may_act(robot | COOKIE_HEADER | {"origin": "https://10.7.5.220:8080"})
    assert not WITH_TOKEN.may_act(robot | COOKIE_HEADER | {"origin": "https://evil.example"})
    assert not WITH_TOKEN.may_act(robot | {"origin": "https://10.7.5.220:8080"})
    for cookie in ("", "a long token", Credentials("x").cookie, "\xff"):
        headers = {"host": "localhost:8080", "cookie": f"ü=1;[]; {COOKIE}={cookie}"}
        assert not WITH_TOKEN.may_view(headers)


def test_only_the_token_is_the_token_and_the_cookie_does_not_contain_it() -> None:
    assert WITH_TOKEN.is_token("a long token")
    assert not any(map(WITH_TOKEN.is_token, ("a long toke", "", "ü")))
    assert "a long token" not in WITH_TOKEN.cookie
