"""``python -m bench.reaction.by_redis board PORT SOCKET | judge SOCKET``: Redis pub/sub."""

import sys
import threading

from redis import Redis

from bench.reaction.pair import HIT, Gate


def board(port: int, path: str) -> None:
    """Stand between the board and the judge until killed."""
    gate, redis = Gate(port), Redis(unix_socket_path=path)
    verdicts = redis.pubsub(ignore_subscribe_messages=True)
    verdicts.subscribe("verdicts")

    def listen() -> None:
        for _ in verdicts.listen():
            gate.brake()

    threading.Thread(target=listen, daemon=True).start()
    while True:
        if gate.take():
            redis.publish("hits", HIT)


def judge(path: str) -> None:
    """Decide until killed."""
    redis = Redis(unix_socket_path=path)
    hits = redis.pubsub(ignore_subscribe_messages=True)
    hits.subscribe("hits")
    for _ in hits.listen():
        redis.publish("verdicts", HIT)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["board", port, path]:
            board(int(port), path)
        case ["judge", path]:
            judge(path)
