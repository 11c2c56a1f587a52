"""Credentials: which requests may view and which may act."""

import pytest

from services.dashboard.credentials import COOKIE, Credentials, new_token

LOCAL, WITH_TOKEN = Credentials(), Credentials("a long token")
COOKIE_HEADER = {"cookie": f"other=1; {COOKIE}={WITH_TOKEN.cookie}"}


@pytest.mark.parametrize("host", ["localhost:8080", "127.0.0.1:8080", "localhost", "[::1]:8080"])
def test_localhost_may_view_and_act_without_a_token(host: str) -> None:
    assert LOCAL.may_view({"host": host})
    assert LOCAL.may_act({"host": host, "origin": f"http://{host}"})


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8080", "", "[::1", "10.7.5.9:8080"])
def test_another_host_name_is_refused_without_a_token(host: str) -> None:
    assert not LOCAL.may_view({"host": host})
    assert not LOCAL.may_act({"host": host, "origin": f"http://{host}"})


def test_a_request_without_a_host_is_refused() -> None:
    assert not LOCAL.may_view({})


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
    assert WITH_TOKEN.may_view(robot | COOKIE_HEADER)
    assert WITH_TOKEN.may_act(robot | COOKIE_HEADER | {"origin": "https://10.7.5.220:8080"})
    assert not WITH_TOKEN.may_act(robot | COOKIE_HEADER | {"origin": "https://evil.example"})
    assert not WITH_TOKEN.may_act(robot | {"origin": "https://10.7.5.220:8080"})


@pytest.mark.parametrize(
    "cookie",
    [
        "",
        f"{COOKIE}=",
        f"{COOKIE}=a long token",
        f"{COOKIE}={Credentials('x').cookie}",
        "ü=1;[]",
        f"{COOKIE}=\xff",
    ],
)
def test_any_other_cookie_is_refused(cookie: str) -> None:
    assert not WITH_TOKEN.may_view({"host": "localhost:8080", "cookie": cookie})


def test_only_the_token_is_the_token() -> None:
    assert WITH_TOKEN.is_token("a long token")
    assert not WITH_TOKEN.is_token("a long toke")
    assert not WITH_TOKEN.is_token("")
    assert not WITH_TOKEN.is_token("ü")


def test_the_cookie_does_not_contain_the_token() -> None:
    assert "a long token" not in WITH_TOKEN.cookie
    assert WITH_TOKEN.cookie != Credentials("another").cookie


def test_new_tokens_differ() -> None:
    assert len({new_token() for _ in range(20)}) == 20
