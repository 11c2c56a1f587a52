"""Authentication middleware of the web server: valid credentials, or the token page.

Any web page that is open in the same browser can send requests to ``localhost``, too. It cannot
forge its origin, so the origin must be the dashboard's. Without a token the host name must be a
name of this host: DNS rebinding, which points another name to 127.0.0.1, is refused.

Every response carries the headers that exclude other pages and scripts. It ends its connection: the
next request comes on a new one, which the listener always accepts.
"""

import asyncio
import base64
import hashlib
import hmac
import html
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Template
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from services.dashboard.config import Dashboard
from services.dashboard.i18n import TEXTS

COOKIE = "t2_dashboard"
TOKEN_MIN = 8
LOCAL_NAMES = ("localhost", "127.0.0.1", "::1")
WRONG_TOKEN_DELAY_S = 1.0
BODY_MAX = 1024  # bytes of a form with a token
SAFE_METHODS = ("GET", "HEAD")
TOKEN_PAGE = (Path(__file__).parent / "static" / "token.html").read_text(encoding="utf-8")
STYLE = TOKEN_PAGE.partition("<style>")[2].partition("</style>")[0]
STYLE_HASH = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
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
    """The rules for a request; an empty token admits all programs of this host."""

    token: str = ""

    def is_token(self, token: str) -> bool:
        """Return whether this is the token; compared in constant time."""
        return hmac.compare_digest(token.encode(), self.token.encode())

    @property
    def cookie(self) -> str:
        """The value of the cookie: a hash of the token."""
        return hashlib.sha256(f"t2 dashboard {self.token}".encode()).hexdigest()

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
        self._policy = content_policy(settings.camera)
        self._credentials = credentials
        self._secure = bool(settings.certificate)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or WebSocket."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(HEADERS)
                headers.setdefault("content-security-policy", self._policy)
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
        token = await self._submitted(request)
        if self._credentials.is_token(token):
            answer = RedirectResponse("/", status_code=303)
            answer.set_cookie(
                COOKIE,
                self._credentials.cookie,
                httponly=True,
                samesite="strict",
                secure=self._secure,
            )
            return answer
        if token:
            await asyncio.sleep(WRONG_TOKEN_DELAY_S)
        lines = map(html.escape, TEXTS["token_wrong" if token else "token_ask"])
        page = Template(TOKEN_PAGE).substitute(text="<br>".join(lines))
        return HTMLResponse(page, status_code=401)

    async def _submitted(self, request: Request) -> str:
        if request.method != "POST":
            return request.query_params.get("token", "")
        body = b""
        async for part in request.stream():
            body += part
            if len(body) > BODY_MAX:
                return ""
        return parse_qs(body.decode("latin1")).get("token", [""])[0].strip()


def content_policy(camera: str) -> str:
    """Return the policy of the page; only the camera's origin may be shown in it."""
    parts = urlsplit(camera)
    origin = f"{parts.scheme}://{parts.netloc}" if camera else ""
    return (
        f"default-src 'none'; script-src 'self'; connect-src 'self'; "
        f"style-src 'self' 'sha256-{STYLE_HASH}'; img-src 'self' {origin}; "
        "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    )


async def _close(_: Scope, __: Receive, send: Send) -> None:
    await send({"type": "websocket.close", "code": 1008})
