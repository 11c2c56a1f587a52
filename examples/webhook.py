"""POST each new latch of the robot as JSON to a web hook, until Ctrl-C.

python webhook.py http://HOST/HOOK [tcp/127.0.0.1:7447]
"""

import json
import sys
from urllib.request import Request, urlopen

import t2


def post(url: str, body: dict[str, object]) -> None:
    """Send the JSON; report a failure and go on."""
    kind = {"Content-Type": "application/json"}
    try:
        urlopen(Request(url, json.dumps(body).encode(), kind), timeout=5).close()
    except OSError as error:
        print(f"{url}: {error}", file=sys.stderr)


def watch(url: str, endpoint: str) -> None:
    """Compare the latched causes of each state with those of the state before."""
    with t2.connect("001", endpoint=endpoint) as robot:
        known = set[int]()
        for state in robot.safety:
            latched = {each.id: each.name for each in state.causes if each.name in state.latched}
            if latched.keys() - known:
                post(url, {"causes": [*latched.values()], "text": state.text})
            known = set(latched)


if __name__ == "__main__":
    try:
        watch(sys.argv[1], "".join(sys.argv[2:]))
    except KeyboardInterrupt:
        pass
    except t2.T2Error as error:
        sys.exit(str(error))
