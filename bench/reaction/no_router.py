"""``python -m bench.reaction.no_router``: safety in place of the router.

Its first session listens as a peer where the router would. Nothing else differs.
"""

import json
import sys
from itertools import chain, repeat
from unittest.mock import patch

import zenoh

from common.bus import session
from common.settings import BusSettings
from services.safety.__main__ import main

AS_SHIPPED = session.client_config


def listening(where: BusSettings, turn: int = 0) -> zenoh.Config:
    """Return the configuration of the first session: a peer that listens."""
    config = AS_SHIPPED(where, turn)
    config.insert_json5("mode", '"peer"')
    config.insert_json5("connect/endpoints", "[]")
    config.insert_json5("listen/endpoints", json.dumps(where.listen))
    return config


if __name__ == "__main__":
    joins = chain((listening,), repeat(AS_SHIPPED))
    with patch.object(session, "client_config", lambda *given: next(joins)(*given)):
        sys.exit(main())
