"""The thread of the lap: it connects, drives, and ends with the robot's session."""

import threading
from collections.abc import Callable

import t2
from cli.demo.driver import Driver, connected
from cli.demo.record import LapRecord

JOIN_S = 10.0  # an attempt to connect takes 3 s, a call 2 s


class LapThread(threading.Thread):
    """Runs a program on a robot, beside the display, until its end or ``end``."""

    def __init__(
        self,
        program: Callable[[Driver], None],
        record: LapRecord,
        robot: str,
        endpoint: str,
    ) -> None:
        super().__init__(name="lap", daemon=True)
        self._program, self._record = program, record
        self._id, self._endpoint = robot, endpoint
        self._ended = threading.Event()
        self._robot: t2.Robot | None = None
        self._error: Exception | None = None

    def run(self) -> None:
        """Connect, and drive."""
        try:
            self._robot = connected(self._id, self._endpoint, self._ended)
            with self._robot as robot:
                self._record.subscribe(robot)
                self._program(Driver(robot, self._record, self._ended))
                self._record.finished = True
        except Exception as error:  # a closed session raises many
            self._error = None if self._ended.is_set() else error

    def end(self) -> None:
        """Stop the vehicle, disconnect, and wait; raise what the program raised before."""
        self._ended.set()
        if self._robot is not None:
            self._robot.close()
        self.join(JOIN_S)
        if self._error is not None:
            raise self._error
