"""The web server: the page, E-STOP and the browsers' WebSocket, in the main thread."""

import re
import socket
from collections.abc import Callable
from ipaddress import ip_address

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute

from common.errors import LinkError
from services.dashboard import assets
from services.dashboard.auth import Door
from services.dashboard.client_messages import ROBOT
from services.dashboard.config import Dashboard
from services.dashboard.credentials import Gate
from services.dashboard.listener import Listener
from services.dashboard.websocket_hub import WORD_MAX, Viewers

END_S = 1  # that browsers get to hang up
HEADER_MAX = 16_384  # bytes
BACKLOG = 256  # connections that wait to be accepted
RECEIVE_BUFFER = 16_384  # bytes in the kernel per connection: bounds the lead of a flood
# Addresses for documentation (RFC 5737, RFC 3849): nobody has them, the way out leads there.
ELSEWHERE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}


def serving(
    settings: Dashboard,
    robot: str,
    gate: Gate,
    viewers: Viewers,
    listener: Listener,
    *,
    alive: Callable[[], None],
) -> uvicorn.Server:
    """Return the server, ready to run; it calls ``alive`` from its own loop, once a second."""

    async def tick() -> None:
        alive()

    secure = bool(settings.certificate)
    return uvicorn.Server(
        uvicorn.Config(
            Door(_site(robot, viewers), gate, listener.connection, secure),
            loop="asyncio",  # the listener's limits work with this one
            http="h11",
            h11_max_incomplete_event_size=HEADER_MAX,
            backlog=BACKLOG,
            lifespan="off",
            proxy_headers=False,  # limits use the address of the connection, which cannot be forged
            server_header=False,
            log_level="error",
            access_log=False,
            # Small frames, many of them: deflating costs more than it saves.
            ws_per_message_deflate=False,
            ws="websockets-sansio",
            ws_max_size=WORD_MAX,
            ws_ping_interval=5.0,
            ws_ping_timeout=5.0,
            timeout_graceful_shutdown=END_S,
            callback_notify=tick,
            timeout_notify=0,
            ssl_certfile=settings.certificate or None,
            ssl_keyfile=settings.private_key or None,
        )
    )


def _site(robot: str, viewers: Viewers) -> Starlette:
    """Return what stands behind the door."""
    page, files = assets.page(robot), assets.files()

    async def index(_: Request) -> Response:
        return HTMLResponse(page)

    async def file(request: Request) -> Response:
        if (found := files.get(request.path_params["name"])) is None:
            return PlainTextResponse("there is no such file\n", status_code=404)
        return Response(found[0], media_type=found[1])

    # Beside the socket: one tap must get through when that is congested or gone.
    async def stop(request: Request) -> Response:
        host = request.client.host if request.client else "somebody"
        robot = request.path_params["robot"]
        if not re.match(ROBOT, robot) or not viewers.estop(robot, host):
            return PlainTextResponse(
                f"no robot {robot!r} is known here; nothing was sent\n", status_code=404
            )
        return PlainTextResponse("asked\n")

    return Starlette(
        routes=[
            Route("/", index),
            Route("/t2/{name}", file),
            Route("/estop/{robot}", stop, methods=["POST"]),
            WebSocketRoute("/live", viewers.serve),
        ]
    )


def listen(settings: Dashboard) -> Listener:
    """Return a bound socket; raise ``LinkError`` when the port is taken."""
    host, port = settings.host, settings.port
    sock = Listener(socket.AF_INET6 if ":" in host else socket.AF_INET, settings)
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        sock.bind((host, port))
    except OSError as error:
        sock.close()
        raise LinkError(
            f"dashboard.port = {port}: {host} cannot be listened on: {error.strerror}; "
            "another program may have it, name another port"
        ) from None
    return sock


def reachable(host: str) -> str:
    """Return where a browser elsewhere finds what listens here, as a URL names it.

    For "every address" (0.0.0.0, ::) that is the address of the way out; without one, this host's
    name. Nothing is sent.
    """
    if ip_address(host).is_unspecified:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as sock:
                sock.connect((ELSEWHERE[family], 9))
                host = sock.getsockname()[0]
        except OSError:
            return socket.gethostname()
    return f"[{host}]" if ":" in host else host
