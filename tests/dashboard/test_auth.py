"""Authentication of the dashboard's web server."""

import json
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from services.dashboard.auth import COOKIE, Credentials, content_policy
from tests.dashboard.bus_fixture import Peer
from verification.harness.dashboard import Server, dashboard

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


def test_another_page_of_the_same_browser_cannot_act(server: Server, peer: Peer) -> None:
    for origin in (Origin("http://evil.example"), None):
        with pytest.raises(InvalidStatus):
            connect(f"ws://127.0.0.1:{server.port}/live", origin=origin)
    peer.latched = ("estop",)  # so that earlier stops are repeated no more
    peer.wait_for_silence()
    peer.estops.clear()
    request = urllib.request.Request(f"{server.url}estop/001", method="POST")
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(request)
    assert peer.estops == []
    peer.latched = ()


def test_a_rebound_host_name_is_refused(server: Server) -> None:
    request = urllib.request.Request(server.url, headers={"Host": "evil.example"})
    with pytest.raises(urllib.error.HTTPError, match="403") as refused:
        urllib.request.urlopen(request)
    assert b"localhost" in refused.value.read()


@pytest.mark.parametrize("path", ["", "t2/none.js"])
def test_every_response_has_the_security_headers(server: Server, path: str) -> None:
    request = urllib.request.Request(server.url + path, headers={"Origin": "http://evil.example"})
    try:
        answer = urllib.request.urlopen(request)
    except urllib.error.HTTPError as error:
        answer = error
    with answer:
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert answer.headers["x-frame-options"] == "DENY"
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "same-origin"
        assert not [name for name in answer.headers if name.startswith("access-control")]


def browser() -> urllib.request.OpenerDirector:
    """Return a client that stores cookies."""
    return urllib.request.build_opener(urllib.request.HTTPCookieProcessor())


def test_from_the_network_a_token_is_required(endpoint: str, tmp_path: Path) -> None:
    secret = tmp_path / "token"
    secret.write_text("open sesame\n", encoding="utf-8")
    sets = ("dashboard.host=0.0.0.0", f"dashboard.token_file={secret}")
    with dashboard(endpoint, tmp_path, *sets) as server:
        for path in ("t2/dashboard.js", "?token=wrong"):
            with pytest.raises(urllib.error.HTTPError, match="401") as refused:
                browser().open(server.url + path)
            assert b"<form" in refused.value.read()
        with pytest.raises(InvalidStatus):
            connect(f"ws://127.0.0.1:{server.port}/live", origin=Origin(server.url.rstrip("/")))
        one = browser()
        form = urllib.parse.urlencode({"token": "open sesame"}).encode()
        with one.open(server.url, form) as answer:
            assert b'id="texts"' in answer.read()
        with one.open(f"{server.url}t2/dashboard.js") as answer:
            assert answer.status == 200
        assert "open sesame" not in server.log.read_text()


def test_a_new_token_is_logged(endpoint: str, tmp_path: Path) -> None:
    with dashboard(endpoint, tmp_path, "dashboard.host=0.0.0.0") as server:
        lines = [json.loads(line) for line in server.log.read_text().splitlines()]
        where = next(line["open"] for line in lines if line["event"] == "started")
        assert "0.0.0.0" not in where
        with browser().open(f"{server.url}?{urlsplit(where).query}") as answer:
            assert b'id="texts"' in answer.read()


def test_only_the_origin_of_the_camera_may_be_shown() -> None:
    policy = content_policy("http://10.0.0.5:8081/{robot}/stream")
    assert "img-src 'self' http://10.0.0.5:8081; " in policy
    assert "img-src 'self' ; " in content_policy("")
