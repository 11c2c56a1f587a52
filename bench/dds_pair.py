"""``python -m bench.dds_pair``: the two processes of ``loop.run_pair`` on CycloneDDS.

The middleware of ROS 2, with listeners: reliable, keep last 1, on loopback only. The address is a
domain number.
"""

from dataclasses import dataclass

from cyclonedds.core import Listener, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from bench.loop import Call, run_pair

CONFIG = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><Peers>"
    "<Peer Address='127.0.0.1'/></Peers><ParticipantIndex>auto</ParticipantIndex>"
    "</Discovery></Domain></CycloneDDS>"
)
KEPT: list[object] = []  # as long as the process
QOS = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1))


@dataclass
class Hit(IdlStruct, typename="Hit"):  # type: ignore[call-arg] # its package is not followed
    """A hit or its answer."""

    pressed: uint8


class OnData(Listener):
    """Calls back for each sample, in CycloneDDS's own thread."""

    def __init__(self, take: Call) -> None:
        super().__init__()
        self._take = take

    def on_data_available(self, reader: DataReader) -> None:
        """Take all samples."""
        for _ in reader.take():
            self._take()


def join(where: str, writes: str, reads: str, take: Call | None) -> Call:
    """Join a domain."""
    domain = Domain(int(where), CONFIG)
    participant = DomainParticipant(int(where))
    written, read = (Topic(participant, name, Hit, qos=QOS) for name in (writes, reads))
    writer = DataWriter(participant, written, qos=QOS)

    def send() -> None:
        writer.write(Hit(1))

    reader = DataReader(participant, read, qos=QOS, listener=OnData(take or send))
    KEPT.extend([domain, participant, reader])
    return send


if __name__ == "__main__":
    run_pair(join)
