"""Unkind firmware and cables, each permitted by the manual: group 22."""

from verification.outside.board import Board, Faults
from verification.outside.cable import Packing, Port
from verification.outside.course import COURSE, Findings, course
from verification.outside.scenarios.board import NO_SWITCHES
from verification.outside.testbed import Prepare, Result, Testbed, scenario

SAFETY = ("e-stop", "contact", "wall")  # findings that are not about availability
NO_CONTACT = "wall: 0 contacts"  # but it stopped far from the wall


def packing(what: Packing) -> Prepare:
    def prepare(board: Board) -> None:
        board.packing = what

    return prepare


@scenario(
    22,
    "the board stops by itself after 0.3 s without a command",
    COURSE,
    faults=lambda: Faults(watchdog=0.3),
)
def profile_watchdog(bed: Testbed) -> Result:
    return course(bed).result()


@scenario(22, "answers on the second port only", COURSE, faults=lambda: Faults(answer_ports=(1,)))
def profile_one_port(bed: Testbed) -> Result:
    return course(bed).result()


@scenario(
    22,
    "the board echoes no switch; require_switches = false is accepted",
    COURSE,
    sets=NO_SWITCHES,
    sets_if_known=("bridge.require_switches=false", "bridge.unsafe_overrides=require_switches"),
    faults=lambda: Faults(switch_echo=False),
)
def profile_no_switch_echo(bed: Testbed) -> Result:
    return course(bed).result()


@scenario(
    22,
    "the first port loses one datagram in twenty, either way",
    "it may stop (4 of 10 lost polls do); BRAKE within 0.1 s of an e-stop and of a contact, no RUN "
    "forward later; no contact with a wall",
    faults=lambda: Faults(ports=(Port(lost=0.05), Port())),
)
def profile_lossy_port(bed: Testbed) -> Result:
    found = course(bed)
    judged = [text for text in found.texts if text.startswith(SAFETY)]
    wrong = [text for text in found.wrong if text in judged and not text.startswith(NO_CONTACT)]
    if not any(text.startswith(("e-stop", "contact")) for text in judged):
        wrong.append("neither an e-stop nor a contact was tried")
    return Findings(found.texts, wrong).result()


@scenario(
    22,
    "one datagram in five comes twice, either way",
    COURSE,
    faults=lambda: Faults(ports=(Port(doubled=0.2), Port(doubled=0.2))),
)
def profile_doubled_datagrams(bed: Testbed) -> Result:
    return course(bed).result()


@scenario(
    22,
    "the second port is 20 to 50 ms late, its datagrams overtake each other",
    COURSE,
    faults=lambda: Faults(ports=(Port(), Port(delay=0.02, jitter=0.03))),
)
def profile_late_port(bed: Testbed) -> Result:
    return course(bed).result()


@scenario(
    22, "one frame in 50 is split over two datagrams", COURSE, prepare=packing(Packing(split=0.02))
)
def profile_split_frames(bed: Testbed) -> Result:
    return course(bed).result()


@scenario(
    22, "frames wait up to 20 ms for each other", COURSE, prepare=packing(Packing(merge=0.02))
)
def profile_merged_frames(bed: Testbed) -> Result:
    return course(bed).result()
