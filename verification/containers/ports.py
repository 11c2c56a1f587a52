"""Ports of one run's own: other stacks may run beside it."""

import socket
from dataclasses import dataclass

from verification.harness.ports import free_port


@dataclass(frozen=True)
class Ports:
    """All that the host's network gets to see."""

    board: int
    first: int
    second: int
    control: int
    router: int
    page: int

    @classmethod
    def free(cls) -> "Ports":
        """Return ports that nobody has."""
        board, first, second, control = (free_port(socket.SOCK_DGRAM) for _ in range(4))
        return cls(board, first, second, control, router=free_port(), page=free_port())

    def settings(self) -> list[str]:
        """Return them as settings of the services."""
        return [
            f"board.port={self.board}",
            f"board.listen_ports={self.first},{self.second}",
            f"sim.control_port={self.control}",
        ]

    def variables(self) -> dict[str, str]:
        """Return them as variables of compose.yaml."""
        return {
            "T2_ROUTER_ADDRESS": "127.0.0.1",
            "T2_ROUTER_PORT": str(self.router),
            "T2_DASHBOARD_PORT": str(self.page),
        }
