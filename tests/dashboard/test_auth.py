"""Authentication of the dashboard's web server."""

import html
import itertools
import json
import os
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from email.message import Message
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from services.dashboard.auth import COOKIE, Credentials
from services.dashboard.config import Dashboard
from services.dashboard.guess_limit import BURST
from services.dashboard.host import credentials
from tests.dashboard.bus_fixture import Peer
from verification.harness.dashboard import Server, dashboard
from verification.harness.waiting import wait_until

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


PAGES = [
    ("?robot=007", "/?robot=007"),
    ("?token=wrong&robot=007&x=%22%3E%3Cscript%3E", "/?robot=007&x=%22%3E%3Cscript%3E"),
    ("/evil.example/?robot=007", "/?robot=007"),
    ("t2/dashboard.js?robot=%2F%2Fevil.example", "/?robot=%2F%2Fevil.example"),
    ("", "/"),
    ("log?robot=007", "/log?robot=007"),
]


class NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_: object) -> None:
        return None


def answer_of(url: str, form: bytes | None = None) -> tuple[int, Message, str]:
    """Return status, headers and body of a client without cookies."""
    try:
        answer = urllib.request.build_opener(NoRedirect).open(url, form)
    except urllib.error.HTTPError as error:
        answer = error
    with answer:
        return answer.status, answer.headers, answer.read().decode()


@pytest.fixture(scope="module")
def with_token(endpoint: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A dashboard with the token "open sesame"."""
    folder = tmp_path_factory.mktemp("token")
    (folder / "token").write_text("open sesame\n", encoding="utf-8")
    with dashboard(endpoint, folder, f"dashboard.token_file={folder / 'token'}") as server:
        yield server


@pytest.mark.parametrize(("path", "page"), PAGES)
def test_every_way_to_log_in_keeps_the_query(with_token: Server, path: str, page: str) -> None:
    code, _, body = answer_of(with_token.url + path)
    assert code == 401
    assert f'<form method=post action="{html.escape(page)}">' in body
    form = urllib.parse.urlencode({"token": "open sesame"}).encode()
    query = f"{path.replace('token=wrong&', '')}{'&' if '?' in path else '?'}token=open+sesame"
    for url, content in ((path, form), (query, None)):
        code, headers, _ = answer_of(with_token.url + url, content)
        assert (code, headers["location"]) == (303, page)
        assert "samesite=lax" in headers["set-cookie"].lower()


def test_wrong_tokens_are_limited_and_a_login_that_exists_goes_on(with_token: Server) -> None:
    one = browser()
    with one.open(f"{with_token.url}?token=open+sesame") as answer:
        assert answer.status == 200
    guesses = itertools.count()

    def right_is_refused() -> bool:
        codes = [answer_of(f"{with_token.url}?token={next(guesses)}")[0] for _ in range(BURST + 1)]
        assert set(codes) <= {401, 429}
        code, headers, body = answer_of(f"{with_token.url}?token=open+sesame")
        if code != 429:
            return False  # the host has stalled: there is another guess
        assert int(headers["retry-after"]) >= 1
        assert "Too many wrong tokens" in body
        return True

    wait_until(right_is_refused, "a refusal")
    stop = urllib.request.Request(
        f"{with_token.url}estop/001",
        method="POST",
        headers={"Origin": with_token.url.rstrip("/")},
    )
    with one.open(stop) as answer:
        assert answer.status == 200


def test_the_cookie_lasts_as_long_as_the_file_and_is_no_guess_of_the_token(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text("open sesame", encoding="utf-8")
    settings = Dashboard(token_file=str(file))
    first = credentials(settings)
    assert credentials(settings).cookie == first.cookie
    assert first.cookie != Credentials("open sesame").cookie
    os.utime(file, ns=(1, 1))
    assert credentials(settings).cookie != first.cookie


def test_a_new_token_is_logged(endpoint: str, tmp_path: Path) -> None:
    with dashboard(endpoint, tmp_path, "dashboard.host=0.0.0.0") as server:
        lines = [json.loads(line) for line in server.log.read_text().splitlines()]
        where = next(line["open"] for line in lines if line["event"] == "started")
        assert "0.0.0.0" not in where
        with browser().open(f"{server.url}?{urlsplit(where).query}") as answer:
            assert b'id="texts"' in answer.read()
