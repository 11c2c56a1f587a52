"""CycloneDDS, the middleware of ROS 2, with listeners; ``where`` is a domain number.

Reliable, keep last 1, on loopback only.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cyclonedds.core import Listener, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from bench.adapters import protocols

CONFIG = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><Peers>"
    "<Peer Address='127.0.0.1'/></Peers><ParticipantIndex>auto</ParticipantIndex>"
    "</Discovery></Domain></CycloneDDS>"
)
QOS = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1))


@dataclass
class Hit(IdlStruct, typename="Hit"):  # type: ignore[call-arg] # its package is not followed
    """A hit or its answer."""

    pressed: uint8


@dataclass
class Twist(IdlStruct, typename="Twist"):  # type: ignore[call-arg] # its package is not followed
    """A twist in the encoding of DDS."""

    linear: float64
    angular: float64


class OnData(Listener):
    """Calls back with each sample, in CycloneDDS's own thread."""

    def __init__(self, take: Callable[[Any], object]) -> None:
        super().__init__()
        self._take = take

    def on_data_available(self, reader: DataReader) -> None:
        """Take all samples."""
        for sample in reader.take():
            self._take(sample)


class Participant:
    """One process's participant in the domain; keep it as long as its readers and writers."""

    def __init__(self, domain: str) -> None:
        self._domain = Domain(int(domain), CONFIG)
        self._participant = DomainParticipant(int(domain))

    def writer(self, name: str, kind: type[IdlStruct]) -> DataWriter:
        """Return a writer of a topic."""
        topic = Topic(self._participant, name, kind, qos=QOS)
        return DataWriter(self._participant, topic, qos=QOS)

    def reader(self, name: str, kind: type[IdlStruct], take: Callable[[Any], object]) -> DataReader:
        """Return a reader of a topic with a callback."""
        topic = Topic(self._participant, name, kind, qos=QOS)
        return DataReader(self._participant, topic, qos=QOS, listener=OnData(take))


def source(where: str) -> protocols.Twist:
    """Return a function that publishes a twist."""
    participant = Participant(where)
    writer = participant.writer("twist", Twist)

    def publish(linear: float, angular: float, _: Participant = participant) -> None:
        writer.write(Twist(linear, angular))

    return publish


def subscribe(where: str, take: protocols.Twist) -> None:
    """Pass received twists on until killed."""
    participant = Participant(where)
    _reader = participant.reader("twist", Twist, lambda twist: take(twist.linear, twist.angular))
    threading.Event().wait()


def board(sock: protocols.BoardSocket, where: str) -> None:
    """Run the process at the board until killed."""
    participant = Participant(where)
    hits = participant.writer("hits", Hit)
    _reader = participant.reader("verdicts", Hit, lambda _: sock.brake())
    while True:
        if sock.receive_hit():
            hits.write(Hit(1))


def decide(where: str) -> None:
    """Run the process that decides until killed."""
    participant = Participant(where)
    verdicts = participant.writer("verdicts", Hit)
    _reader = participant.reader("hits", Hit, lambda _: verdicts.write(Hit(1)))
    threading.Event().wait()
