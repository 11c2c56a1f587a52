"""Key expression matching in a Zenoh router takes exponential time: one row for each ``**``.

python reproduce.py        # starts a router of its own on loopback, and kills it; at most a minute

Two clients: one subscribes to ``x/`` + n times ``**/a/`` + ``b``, the other puts once on ``x/`` and
forty chunks ``a``. Then a third client opens a session, declares a subscriber on another key,
closes it, opens a session again and asks the router one question.
"""

import contextlib
import os
import subprocess
import sys
import threading
import time

import zenoh

CHUNKS, LIMIT_S = 40, 10.0
WHERE = "tcp/127.0.0.1:17447"
ROUTER = f"""
import time, zenoh
config = zenoh.Config.from_json5('''{{mode: "router", listen: {{endpoints: ["{WHERE}"]}},
  adminspace: {{enabled: true}}, scouting: {{multicast: {{enabled: false}}}}}}''')
with zenoh.open(config):
    print("up", flush=True)
    time.sleep(60)
"""
CLIENT = f'{{mode: "client", connect: {{endpoints: ["{WHERE}"]}}}}'


def client() -> zenoh.Session:
    """Open a session with the router."""
    return zenoh.open(zenoh.Config.from_json5(CLIENT))


def hung_s(expression: str, key: str) -> float:
    """Return how long a new session waits for an answer; ``LIMIT_S`` at most."""
    command = [sys.executable, "-c", ROUTER]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as router:
        try:
            assert router.stdout is not None
            router.stdout.readline()
            reader, writer = client(), client()
            kept = reader.declare_subscriber(expression, lambda _: None)
            time.sleep(0.3)
            writer.put(key, b"")
            time.sleep(0.1)
            began_s = time.monotonic()
            asking = threading.Thread(target=query_router, daemon=True)
            asking.start()
            asking.join(LIMIT_S)
            del kept
            return time.monotonic() - began_s
        finally:
            router.kill()


def query_router() -> None:
    """Query the router, unless the router is killed meanwhile."""
    with contextlib.suppress(zenoh.ZError):
        query_anew()


def query_anew() -> None:
    """Send one query to the router in a new session, after another one has come and gone."""
    with client() as newcomer:  # the router wants its tables for itself, and waits for the matching
        newcomer.declare_subscriber("y", lambda _: None)
        time.sleep(0.1)
    list(client().get("@/*/router", timeout=LIMIT_S))


if __name__ == "__main__":
    for n in range(1, 9):
        seconds = hung_s("x/" + "**/a/" * n + "b", "x/" + "/".join("a" * CHUNKS))
        print(f"{n} times **: {seconds:6.2f} s", flush=True)  # noqa: T201
        if seconds >= LIMIT_S:
            break
    os._exit(0)  # sessions of dead routers take long to close
