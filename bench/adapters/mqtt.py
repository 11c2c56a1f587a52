"""MQTT by paho, QoS 0; ``where`` is the broker's port on loopback."""

import socket
from collections.abc import Callable

from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from bench.adapters.protocols import HIT, BoardSocket, Twist, packed, unpacked


def connected(where: str, topic: str = "", take: Callable[[bytes], object] | None = None) -> Client:
    """Return a client of the broker with TCP_NODELAY; it passes payloads of a topic on."""
    client = Client(CallbackAPIVersion.VERSION2)
    client.on_socket_open = lambda _, __, sock: sock.setsockopt(
        socket.IPPROTO_TCP, socket.TCP_NODELAY, 1
    )
    if take is not None:
        client.on_connect = lambda *_: client.subscribe(topic)
        client.on_message = lambda _, __, message: take(message.payload)
    client.connect("127.0.0.1", int(where))
    return client


def source(where: str) -> Twist:
    """Return a function that publishes a twist."""
    client = connected(where)
    client.loop_start()
    return lambda *twist: client.publish("twist", packed(*twist))


def subscribe(where: str, take: Twist) -> None:
    """Pass received twists on until killed."""
    connected(where, "twist", lambda raw: take(*unpacked(raw))).loop_forever()


def board(sock: BoardSocket, where: str) -> None:
    """Run the process at the board until killed."""
    client = connected(where, "verdicts", lambda _: sock.brake())
    client.loop_start()
    while True:
        if sock.receive_hit():
            client.publish("hits", HIT)


def decide(where: str) -> None:
    """Run the process that decides until killed."""
    client = connected(where, "hits", lambda _: client.publish("verdicts", HIT))
    client.loop_forever()
