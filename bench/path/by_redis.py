"""Redis pub/sub; ``where`` is the server's socket."""

from redis import Redis

from bench.path.twist import Say, packed, unpacked


def sender(where: str) -> Say:
    """Return what sends."""
    redis = Redis(unix_socket_path=where)
    return lambda *twist: redis.publish("twist", packed(*twist))


def listen(where: str, take: Say) -> None:
    """Take what comes, until killed."""
    came = Redis(unix_socket_path=where).pubsub(ignore_subscribe_messages=True)
    came.subscribe("twist")
    for message in came.listen():
        take(*unpacked(message["data"]))
