"""The door of the web server: every request passes the gate, or is asked for the token."""

import asyncio
import html
from urllib.parse import parse_qs

from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from services.dashboard.gate import COOKIE, Gate
from services.dashboard.texts import TEXTS

WRONG_S = 1.0  # what a wrong token costs
BODY_MAX = 1024  # bytes of a form with a token
SAFE = ("GET", "HEAD")


class Door:
    """Lets through to the application what the gate lets in."""

    def __init__(self, app: ASGIApp, gate: Gate, secure: bool) -> None:
        self.app = app
        self._gate = gate
        self._secure = secure

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or connection."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        headers = {
            name.decode("latin1"): value.decode("latin1") for name, value in scope["headers"]
        }
        acts = scope["type"] == "websocket" or scope["method"] not in SAFE
        if self._gate.lets_act(headers) if acts else self._gate.lets_in(headers):
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            answer = await self._ask(Request(scope, receive))
            await answer(scope, receive, send)

    async def _ask(self, request: Request) -> Response:
        if not self._gate.token:
            name = f"{request.url.scheme}://localhost:{request.scope['server'][1]}"
            return PlainTextResponse(f"Open the dashboard as {name}\n", status_code=403)
        token = await self._given(request)
        if self._gate.knows(token):
            answer = RedirectResponse("/", status_code=303)
            answer.set_cookie(
                COOKIE, self._gate.badge, httponly=True, samesite="strict", secure=self._secure
            )
            return answer
        if token:
            await asyncio.sleep(WRONG_S)
        return HTMLResponse(asking(wrong=bool(token)), status_code=401)

    async def _given(self, request: Request) -> str:
        if request.method != "POST":
            return request.query_params.get("token", "")
        body = b""
        async for part in request.stream():
            body += part
            if len(body) > BODY_MAX:
                return ""
        return parse_qs(body.decode("latin1")).get("token", [""])[0].strip()


def asking(wrong: bool) -> str:
    """Return the page that asks for the token."""
    lines = [html.escape(text) for text in TEXTS["token_wrong" if wrong else "token_ask"]]
    return f"""<!doctype html><meta charset=utf-8><title>T2</title>
<meta name=viewport content="width=device-width, initial-scale=1">
<style>body{{font:18px system-ui,sans-serif;background:#0d1117;color:#f0f6fc;display:grid;
place-content:center;min-height:90vh;gap:12px;text-align:center}}input,button{{font:inherit;
padding:12px;border-radius:8px;border:1px solid #57606a;width:100%;box-sizing:border-box}}
button{{background:#1f6feb;color:#fff;margin-top:12px}}</style>
<form method=post action="/"><h1>T2</h1><p>{"<br>".join(lines)}</p>
<input name=token type=password autofocus autocomplete=current-password><button>OK</button></form>
"""
