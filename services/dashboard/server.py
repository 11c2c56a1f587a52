"""The web server: page, E-STOP and WebSocket, in the main thread."""

import html
import json
import math
import re
import shlex
import socket
from collections import Counter
from collections.abc import Callable, Sequence
from ipaddress import ip_address
from pathlib import Path
from string import Template

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from services.dashboard.auth import AuthMiddleware, Credentials
from services.dashboard.client_messages import NAME_MAX, ROBOT
from services.dashboard.config import Dashboard
from services.dashboard.floor_plan import FloorPlan
from services.dashboard.i18n import table
from services.dashboard.listener import BACKLOG, Listener
from services.dashboard.websocket_hub import MESSAGE_MAX, WebSocketHub
from services.dashboard.websocket_protocol import WebSocketProtocol
from t2.errors import LinkError

SHUTDOWN_S = 1  # for browsers to disconnect
STATIC = Path(__file__).parent / "static"
HEADER_MAX = 16_384  # bytes
ROBOT_ID = "{the robot}"
# Documentation addresses (RFC 5737, RFC 3849), which route to the default gateway.
REMOTE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}


def serving(
    settings: Dashboard,
    robot: str,
    credentials: Credentials,
    hub: WebSocketHub,
    listener: Listener,
    *,
    template: str,
    plan: FloorPlan | None,
    alive: Callable[[], None],
) -> uvicorn.Server:
    """Return the server, ready to run; it calls ``alive`` in its own loop, once a second."""

    async def tick() -> None:
        alive()

    return uvicorn.Server(
        uvicorn.Config(
            AuthMiddleware(
                _application(template, robot, hub, listener, plan), credentials, settings
            ),
            loop="asyncio",  # the listener needs it
            http="h11",
            h11_max_incomplete_event_size=HEADER_MAX,
            backlog=BACKLOG,
            lifespan="off",
            proxy_headers=False,
            server_header=False,
            log_config=None,  # its lines go through common/log.py
            log_level="error",  # any client can cause warnings
            access_log=False,
            ws=WebSocketProtocol,
            ws_per_message_deflate=True,
            ws_max_size=MESSAGE_MAX,
            ws_ping_interval=5.0,
            ws_ping_timeout=5.0,
            timeout_graceful_shutdown=SHUTDOWN_S,
            callback_notify=tick,
            timeout_notify=0,
            ssl_certfile=settings.certificate or None,
            ssl_keyfile=settings.private_key or None,
        )
    )


def _application(
    template: str, robot: str, hub: WebSocketHub, listener: Listener, plan: FloorPlan | None
) -> Starlette:
    """Return the application behind the authentication."""
    log_template = Template((STATIC / "log.html").read_text(encoding="utf-8"))
    log_page = log_template.substitute(robot=ROBOT_ID, texts=_script(table()))

    async def index(request: Request) -> Response:
        shown = request.query_params.get("robot", robot)
        if not re.match(ROBOT, shown):
            return PlainTextResponse("not the id of a robot\n", status_code=404)
        page = log_page if request.url.path == "/log" else template
        return HTMLResponse(page.replace(ROBOT_ID, shown))

    async def log_rows(request: Request) -> Response:
        before = re.fullmatch(r"\d{1,18}|[1-8]\d{18}", request.query_params.get("before", ""))
        rows = await hub.log(
            request.query_params.get("robot", robot), int(before[0]) if before else None
        )
        if rows is None:
            return PlainTextResponse("the bus does not respond\n", status_code=504)
        return Response(rows, media_type="application/json")

    # Besides the WebSocket: a stop must arrive when that is congested or closed.
    async def stop(request: Request) -> Response:
        host = request.client.host if request.client else "unknown"
        name = request.query_params.get("name", "")[:NAME_MAX] or host
        robot = request.path_params["robot"]
        if not hub.estop(robot, name, seconds(request.query_params.get("age", ""))):
            return PlainTextResponse(
                f"robot {robot!r} is unknown; no stop was sent\n", status_code=404
            )
        return PlainTextResponse("requested\n")

    async def live(socket: WebSocket) -> None:
        listener.upgraded(socket.client)
        await hub.serve(socket)

    return Starlette(
        routes=[
            Route("/", index),
            *_floor_plan(plan),
            Route("/log", index),
            Route("/log/rows", log_rows),
            Mount("/t2", StaticFiles(directory=STATIC)),
            Route("/estop/{robot}", stop, methods=["POST"]),
            WebSocketRoute("/live", live),
        ]
    )


def _floor_plan(plan: FloorPlan | None) -> list[Route]:
    response = plan and Response(plan.image, media_type=plan.kind)
    return [Route("/floor-plan", response, methods=["GET"])] if response else []


def seconds(text: str) -> float:
    """Return a time of a query; 0 if it is none: an emergency stop is never refused for it."""
    try:
        return float(text) if math.isfinite(float(text)) else 0.0
    except ValueError:
        return 0.0


def _script(content: object) -> str:
    """Return JSON for a script element, which no text of it can end."""
    return json.dumps(content, ensure_ascii=False).replace("<", "\\u003c")


def page(settings: Dashboard, router: Sequence[str], words: Sequence[str]) -> str:
    """Return the page, with ``ROBOT_ID`` in place of the robot that it shows.

    Without a connection it names the router's endpoints, and `t2 doctor` with the option ``words``.
    """
    doctor = f"t2 doctor --robot {ROBOT_ID} {shlex.join(words)}".strip()
    template = Template((STATIC / "index.html").read_text(encoding="utf-8"))
    return template.substitute(
        robot=ROBOT_ID, texts=_script(table()),
        router=html.escape(", ".join(router)),
        doctor=html.escape(doctor),
    )  # fmt: skip


def listen(settings: Dashboard, counters: Counter[str]) -> Listener:
    """Return a bound socket; raise ``LinkError`` if the port is in use."""
    host, port = settings.host, settings.port
    sock = Listener(socket.AF_INET6 if ":" in host else socket.AF_INET, counters)
    try:
        sock.bind((host, port))
    except OSError as error:
        sock.close()
        raise LinkError(
            f"dashboard.port = {port}: cannot listen on {host}: {error.strerror}; "
            "if another program uses the port, set another one"
        ) from None
    return sock


def reachable(host: str) -> str:
    """Return the host part of the URL for browsers on other hosts.

    For the unspecified address (0.0.0.0, ::) this is the address of the default route, or without
    one this host's name. Nothing is sent.
    """
    if ip_address(host).is_unspecified:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as sock:
                sock.connect((REMOTE[family], 9))
                host = sock.getsockname()[0]
        except OSError:
            return socket.gethostname()
    return f"[{host}]" if ":" in host else host
