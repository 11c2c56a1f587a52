"""Redis pub/sub; ``where`` is the server's Unix socket."""

import threading
from typing import Any

from redis import Redis

from bench.adapters.protocols import HIT, BoardSocket, Twist, packed, unpacked


def subscription(redis: Redis, channel: str) -> Any:
    """Return a subscription to a channel."""
    made = redis.pubsub(ignore_subscribe_messages=True)
    made.subscribe(channel)
    return made


def source(where: str) -> Twist:
    """Return a function that publishes a twist."""
    redis = Redis(unix_socket_path=where)
    return lambda *twist: redis.publish("twist", packed(*twist))


def subscribe(where: str, take: Twist) -> None:
    """Pass received twists on until killed."""
    for message in subscription(Redis(unix_socket_path=where), "twist").listen():
        take(*unpacked(message["data"]))


def board(sock: BoardSocket, where: str) -> None:
    """Run the process at the board until killed."""
    redis = Redis(unix_socket_path=where)
    verdicts = subscription(redis, "verdicts")

    def brake_on_verdicts() -> None:
        for _ in verdicts.listen():
            sock.brake()

    threading.Thread(target=brake_on_verdicts, daemon=True).start()
    while True:
        if sock.receive_hit():
            redis.publish("hits", HIT)


def decide(where: str) -> None:
    """Run the process that decides until killed."""
    redis = Redis(unix_socket_path=where)
    for _ in subscription(redis, "hits").listen():
        redis.publish("verdicts", HIT)
