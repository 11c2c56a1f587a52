"""How long to wait before something that has ended is started again."""

BACKOFF_S = (0.0, 0.5, 1.0, 2.0, 5.0)  # before each restart; the last one stays
CALM_S = 10.0  # what lived this long begins with the first again


class Backoff:
    """Counts the restarts of one thing."""

    def __init__(self) -> None:
        self._restarts = 0

    def after(self, lived_s: float) -> float:
        """Return how many seconds to wait, after it has ended and lived that long."""
        if lived_s > CALM_S:
            self._restarts = 0
        wait_s = BACKOFF_S[min(self._restarts, len(BACKOFF_S) - 1)]
        self._restarts += 1
        return wait_s
