"""The web server: the page by NiceGUI, the pictures by one web socket, in the main thread."""

import re
import socket
from collections.abc import Callable
from ipaddress import ip_address
from pathlib import Path

import uvicorn
from fastapi import FastAPI
from nicegui import app as nicegui_app
from nicegui import ui
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from common.errors import LinkError
from services.dashboard import page
from services.dashboard.config import Dashboard
from services.dashboard.door import Door
from services.dashboard.gate import Gate
from services.dashboard.viewers import Viewers
from services.dashboard.words import ROBOT

STATIC = Path(__file__).parent / "static"
END_S = 1  # that browsers get to hang up
# Addresses for documentation (RFC 5737, RFC 3849): nobody has them, the way out leads there.
ELSEWHERE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}


def serving(
    settings: Dashboard,
    robot: str,
    gate: Gate,
    viewers: Viewers,
    estop: Callable[[str, str], None],
    *,
    alive: Callable[[], None],
) -> uvicorn.Server:
    """Return the server, ready to run; it calls ``alive`` from its own loop, once a second."""

    async def tick() -> None:
        alive()

    return uvicorn.Server(
        uvicorn.Config(
            Door(_site(robot, viewers, estop), gate, secure=bool(settings.certificate)),
            log_level="error",
            access_log=False,
            # Small frames, many of them: deflating costs more than it saves.
            ws_per_message_deflate=False,
            ws="websockets-sansio",
            ws_max_size=65536,
            ws_ping_interval=5.0,
            ws_ping_timeout=5.0,
            timeout_graceful_shutdown=END_S,
            callback_notify=tick,
            timeout_notify=0,
            ssl_certfile=settings.certificate or None,
            ssl_keyfile=settings.private_key or None,
        )
    )


def _site(robot: str, viewers: Viewers, estop: Callable[[str, str], None]) -> FastAPI:
    """Return what stands behind the door."""
    site = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    site.add_api_websocket_route("/live", viewers.serve)

    # Beside the socket: one tap must get through when that has just broken.
    async def stop(request: Request) -> Response:
        host = request.client.host if request.client else "somebody"
        robot = request.path_params["robot"]
        if not re.match(ROBOT, robot):
            return PlainTextResponse("no robot has such a name\n", status_code=404)
        estop(robot, host)
        return PlainTextResponse("asked\n")

    site.add_route("/estop/{robot}", stop, methods=["POST"])
    nicegui_app.add_static_files("/t2", STATIC, max_cache_age=0)

    @ui.page("/", title="T2", viewport=page.VIEWPORT, dark=None)
    def index() -> None:
        page.build(robot)

    ui.run_with(
        site,
        title="T2",
        favicon=STATIC / "icon.svg",
        binding_refresh_interval=None,  # nothing is bound: our own script draws
        tailwind=False,
        show_welcome_message=False,
    )
    return site


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket; raise ``LinkError`` when the port is taken."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    sock = socket.socket(family, socket.SOCK_STREAM)
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
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
