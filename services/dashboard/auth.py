"""Authentication middleware of the web server: valid credentials, or the token page.

Any web page that is open in the same browser can send requests to ``localhost``, too. It cannot
forge its origin, so the origin must be the dashboard's. Without a token the host name must be a
name of this host: DNS rebinding, which points another name to 127.0.0.1, is refused.

The cookie is sent when a link of another page opens the dashboard (``SameSite=Lax``), so that such
a link works; nothing acts on a GET.

Every response carries the headers that exclude other pages and scripts. It ends its connection: the
next request comes on a new one, which the listener always accepts.
"""

import base64
import hashlib
import hmac
import html
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Template
from urllib.parse import parse_qs, urlencode, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from common import clock
from services.dashboard.config import Dashboard
from services.dashboard.guess_limit import GuessLimit
from services.dashboard.i18n import LABELS

COOKIE = "t2_dashboard"
TOKEN_MIN = 8
LOCAL_NAMES = ("localhost", "127.0.0.1", "::1")
BODY_MAX = 1024  # bytes of a form with a token
SAFE_METHODS = ("GET", "HEAD")
PAGES = ("/", "/log")
TOKEN_PAGE = (Path(__file__).parent / "static" / "token.html").read_text(encoding="utf-8")
STYLE = TOKEN_PAGE.partition("<style>")[2].partition("</style>")[0]
STYLE_HASH = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
POLICY = (
    f"default-src 'none'; script-src 'self'; connect-src 'self'; "
    f"style-src 'self' 'sha256-{STYLE_HASH}'; img-src 'self'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
HEADERS = {
    "x-frame-options": "DENY",
    "x-content-type-options": "nosniff",
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
    "connection": "close",
}


@dataclass(frozen=True, slots=True)
class Credentials:
    """The rules for a request; an empty token admits all programs of this host.

    Wrong cookies are not limited, so that a guesser cannot delay who is logged in. ``salt``, which
    nobody on the network knows, keeps a cookie from being a way to guess the token.
    """

    token: str = ""
    salt: str = ""

    def is_token(self, token: str) -> bool:
        """Return whether this is the token; compared in constant time."""
        return hmac.compare_digest(token.encode(), self.token.encode())

    @property
    def cookie(self) -> str:
        """The value of the cookie: a hash of token and salt."""
        return hashlib.sha256(f"t2 dashboard {self.salt} {self.token}".encode()).hexdigest()

    def may_view(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request may view the page, by its cookie or by its host."""
        if not self.token:
            return host_name(headers.get("host", "")) in LOCAL_NAMES
        pairs = (pair.strip().partition("=") for pair in headers.get("cookie", "").split(";"))
        cookie = next((value for name, _, value in pairs if name == COOKIE), "")
        return hmac.compare_digest(cookie.encode(), self.cookie.encode())

    def may_act(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request may drive and stop: it must come from the dashboard's page."""
        origin = headers.get("origin", "").partition("://")[2]
        return self.may_view(headers) and bool(origin) and origin == headers.get("host")


def host_name(host: str) -> str:
    """Return the name in a Host header, without its port; empty if it is invalid."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


class AuthMiddleware:
    """Passes requests with valid credentials to the application."""

    def __init__(self, app: ASGIApp, credentials: Credentials, settings: Dashboard) -> None:
        self.app = app
        self._credentials = credentials
        self._secure = bool(settings.certificate)
        self._guesses = GuessLimit()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or WebSocket."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(HEADERS)
                headers.setdefault("content-security-policy", POLICY)
            await send(message)

        answer = await self._answer(scope, receive)
        await answer(scope, receive, send_with_headers)

    async def _answer(self, scope: Scope, receive: Receive) -> ASGIApp:
        """Return the application for a request with valid credentials, else the refusal."""
        is_socket = scope["type"] == "websocket"
        headers, credentials = Headers(scope=scope), self._credentials
        acts = is_socket or scope["method"] not in SAFE_METHODS
        if credentials.may_act(headers) if acts else credentials.may_view(headers):
            return self.app
        return _close if is_socket else await self._authenticate(Request(scope, receive))

    async def _authenticate(self, request: Request) -> Response:
        if not self._credentials.token:
            name = f"{request.url.scheme}://localhost:{request.scope['server'][1]}"
            return PlainTextResponse(f"Open the dashboard as {name}\n", status_code=403)
        token, page = await self._submitted(request), page_of(request)
        host, now_ns = client_host(request.scope), clock.now_ns()
        wait_s = self._guesses.wait_s(host, token, now_ns) if token else 0.0
        if wait_s:
            return _token_page("token_wait", page, wait_s)
        is_right = bool(token) and self._credentials.is_token(token)
        if token:
            self._guesses.compared(host, token, now_ns, is_right=is_right)
        if is_right:
            answer = RedirectResponse(page, status_code=303)
            answer.set_cookie(
                COOKIE,
                self._credentials.cookie,
                httponly=True,
                samesite="lax",
                secure=self._secure,
            )
            return answer
        return _token_page("token_wrong" if token else "token_ask", page)

    async def _submitted(self, request: Request) -> str:
        if request.method != "POST":
            return request.query_params.get("token", "")
        body = b""
        async for part in request.stream():
            body += part
            if len(body) > BODY_MAX:
                return ""
        return parse_qs(body.decode("latin1")).get("token", [""])[0].strip()


def client_host(scope: Scope) -> str:
    """Return the address of the client."""
    client = scope.get("client")
    return client[0] if client else ""


def page_of(request: Request) -> str:
    """Return the page that a login leads to: this one, with its query but without a token."""
    pairs = [pair for pair in request.query_params.multi_items() if pair[0] != "token"]
    path = request.url.path if request.url.path in PAGES else "/"
    return f"{path}?{urlencode(pairs)}" if pairs else path


def _token_page(text: str, page: str, wait_s: float = 0.0) -> Response:
    lines = (html.escape(line.replace("{}", str(math.ceil(wait_s)))) for line in LABELS[text])
    content = Template(TOKEN_PAGE).substitute(text="<br>".join(lines), page=html.escape(page))
    if not wait_s:
        return HTMLResponse(content, status_code=401)
    return HTMLResponse(content, 429, headers={"retry-after": str(math.ceil(wait_s))})


async def _close(_: Scope, __: Receive, send: Send) -> None:
    await send({"type": "websocket.close", "code": 1008})
