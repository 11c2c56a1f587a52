"""``python -m services.recorder``: a black box, and everything when it is asked for."""

import sys

from services.recorder.life import main

if __name__ == "__main__":
    sys.exit(main())
