"""MQTT by paho, QoS 0; ``where`` is the broker's port on loopback."""

import socket

from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from bench.path.twist import Say, packed, unpacked


def joined(where: str) -> Client:
    """Return a client of the broker that delays nothing."""
    client = Client(CallbackAPIVersion.VERSION2)
    client.on_socket_open = lambda _, __, sock: sock.setsockopt(
        socket.IPPROTO_TCP, socket.TCP_NODELAY, 1
    )
    client.connect("127.0.0.1", int(where))
    return client


def sender(where: str) -> Say:
    """Return what sends."""
    client = joined(where)
    client.loop_start()
    return lambda *twist: client.publish("twist", packed(*twist))


def listen(where: str, take: Say) -> None:
    """Take what comes, until killed."""
    client = joined(where)
    client.on_connect = lambda *_: client.subscribe("twist")
    client.on_message = lambda _, __, message: take(*unpacked(message.payload))
    client.loop_forever()
