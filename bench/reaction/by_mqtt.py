"""``python -m bench.reaction.by_mqtt board PORT BROKER | judge BROKER``: MQTT by paho, QoS 0."""

import socket
import sys
from collections.abc import Callable

from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from bench.reaction.pair import HIT, Gate


def joined(broker: int, topic: str, call: Callable[[], object]) -> Client:
    """Return a client that calls when something comes on a topic."""
    client = Client(CallbackAPIVersion.VERSION2)
    client.on_socket_open = lambda _, __, sock: sock.setsockopt(
        socket.IPPROTO_TCP, socket.TCP_NODELAY, 1
    )
    client.on_connect = lambda *_: client.subscribe(topic)
    client.on_message = lambda *_: call()
    client.connect("127.0.0.1", broker)
    return client


def board(port: int, broker: int) -> None:
    """Stand between the board and the judge until killed."""
    gate = Gate(port)
    client = joined(broker, "verdicts", gate.brake)
    client.loop_start()
    while True:
        if gate.take():
            client.publish("hits", HIT)


def judge(broker: int) -> None:
    """Decide until killed."""
    client = joined(broker, "hits", lambda: client.publish("verdicts", HIT))
    client.loop_forever()


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["board", port, broker]:
            board(int(port), int(broker))
        case ["judge", broker]:
            judge(int(broker))
