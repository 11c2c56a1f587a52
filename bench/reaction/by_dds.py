"""``python -m bench.reaction.by_dds board PORT DOMAIN | judge DOMAIN``: CycloneDDS, by listeners.

What ROS 2 stands on, without ROS 2: reliable, the last sample alone, on loopback.
"""

import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass

from cyclonedds.core import Listener, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from bench.reaction.pair import Gate

CONFIG = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><Peers>"
    "<Peer Address='127.0.0.1'/></Peers><ParticipantIndex>auto</ParticipantIndex>"
    "</Discovery></Domain></CycloneDDS>"
)
QOS = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1))


@dataclass
class Said(IdlStruct, typename="Said"):  # type: ignore[call-arg] # its package is not followed
    """What goes over the bus."""

    pressed: uint8


class Heard(Listener):
    """Calls as soon as something came, in CycloneDDS's own thread."""

    def __init__(self, call: Callable[[], object]) -> None:
        super().__init__()
        self._call = call

    def on_data_available(self, reader: DataReader) -> None:
        """Take all that came, and call."""
        if reader.take():
            self._call()


class Ends:
    """One process's writer and reader."""

    def __init__(self, domain: int, says: str, hears: str, call: Callable[[], object]) -> None:
        self._domain = Domain(domain, CONFIG)
        self._participant = DomainParticipant(domain)
        out, back = (Topic(self._participant, name, Said, qos=QOS) for name in (says, hears))
        self._writer = DataWriter(self._participant, out, qos=QOS)
        self._reader = DataReader(self._participant, back, qos=QOS, listener=Heard(call))

    def say(self) -> None:
        """Say it."""
        self._writer.write(Said(1))


def board(port: int, domain: int) -> None:
    """Stand between the board and the judge until killed."""
    gate = Gate(port)
    ends = Ends(domain, "hits", "verdicts", gate.brake)
    while True:
        if gate.take():
            ends.say()


def judge(domain: int) -> None:
    """Decide until killed."""
    ends = Ends(domain, "verdicts", "hits", lambda: ends.say())
    threading.Event().wait()


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["board", port, domain]:
            board(int(port), int(domain))
        case ["judge", domain]:
            judge(int(domain))
