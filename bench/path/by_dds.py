"""CycloneDDS, set as for ``bench.reaction``; ``where`` is a domain."""

import threading
from dataclasses import dataclass

from cyclonedds.core import Listener
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from bench.path.twist import Say
from bench.reaction.by_dds import CONFIG, QOS


@dataclass
class Twist(IdlStruct, typename="Twist"):  # type: ignore[call-arg] # its package is not followed
    """What goes over the bus, in DDS's own format."""

    linear: float64
    angular: float64


class Heard(Listener):
    """Takes what came, in CycloneDDS's own thread."""

    def __init__(self, take: Say) -> None:
        super().__init__()
        self._take = take

    def on_data_available(self, reader: DataReader) -> None:
        """Take all that came."""
        for twist in reader.take():
            self._take(twist.linear, twist.angular)


class End:
    """One process's part in the domain; all of it has to be kept."""

    def __init__(self, domain: str) -> None:
        self._domain = Domain(int(domain), CONFIG)
        self.participant = DomainParticipant(int(domain))
        self.topic = Topic(self.participant, "twist", Twist, qos=QOS)


def sender(where: str) -> Say:
    """Return what sends."""
    end = End(where)
    writer = DataWriter(end.participant, end.topic, qos=QOS)

    def say(linear: float, angular: float, _: End = end) -> None:
        writer.write(Twist(linear, angular))

    return say


def listen(where: str, take: Say) -> None:
    """Take what comes, until killed."""
    end = End(where)
    reader = DataReader(end.participant, end.topic, qos=QOS, listener=Heard(take))
    threading.Event().wait()
    del reader
