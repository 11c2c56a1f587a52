"""``python -m services.metrics``: what Prometheus asks for."""

import sys

from services.metrics.life import main

if __name__ == "__main__":
    sys.exit(main())
