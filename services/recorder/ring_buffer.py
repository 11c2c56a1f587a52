"""The last minutes, in memory: bounded in time and in bytes. Pure."""

from collections import deque

from common.sample import Sample

# What Python takes for a sample beside its bytes, with key and encoding: 380 B by tracemalloc.
OVERHEAD = 400


class Memory:
    """Keeps the newest samples; the oldest go first."""

    def __init__(self, span_ns: int, size_max: int) -> None:
        self.size = 0  # bytes, as reckoned
        self._span_ns = span_ns
        self._size_max = size_max
        self._samples: deque[Sample] = deque()

    def add(self, sample: Sample) -> None:
        """Keep one more; what is too old by its time, or too much by its size, goes."""
        self._samples.append(sample)
        self.size += sample.size + OVERHEAD
        oldest_ns = sample.received_ns - self._span_ns
        while self._samples[0].received_ns < oldest_ns or self.size > self._size_max:
            self.size -= self._samples.popleft().size + OVERHEAD
            if not self._samples:
                return

    def samples(self) -> list[Sample]:
        """Return all that is kept, the oldest first."""
        return list(self._samples)
