"""Every cell of the table in ``docs/security.md``, with real certificates and sessions.

A denied message leaves no trace. So each trial ends with an allowed message on the same session:
once it has arrived, earlier messages that are missing were denied.
"""

import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from typing import Any

import pytest
import zenoh
import zenoh.ext

from cli.keys.access import Verb
from cli.keys.machine_settings import ros_override
from common.bus.session import client_config
from t2 import keys
from tools.rights_table import CLASSES, MINE, ROLES, may
from verification.harness.bus import at
from verification.harness.certificates import Site, connecting
from verification.harness.waiting import wait_until

KEYS = tuple(CLASSES.values())
PLAIN = tuple(key for key in KEYS if "*" not in key)  # usable for a queryable or a token
BLOCK = zenoh.CongestionControl.BLOCK  # no message may be dropped by congestion
TIMEOUT_S = 2.0
Came = list[tuple[str, str]]
# `**` does not match chunks that begin with @.
EVERY = ("**", "**/@cmd/**", "**/@adv/**", "@ros2_lv/**")


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mapping[str, zenoh.Session]]:
    """Sessions of every role at one router, and one on board."""
    site = Site(tmp_path_factory.mktemp("site") / "keys")
    certified = {
        "viewer": site.member("viewer", "hall"),
        "driver of 001": site.member("driver", "anna", "--robot", MINE),
        "driver of 001 as nav": site.member("driver", "nav", "--robot", MINE, "--source", "nav"),
        "device lidar of 001": site.member("device", "lidar", "--robot", MINE),
        "fleet": site.member("fleet", "room"),
        "site's router": site.member("site", "berlin", "--address", "127.0.0.1"),
        "router of 001": site.member("robot", MINE, "--address", "127.0.0.1"),
        "ros of 001": site.member("ros", "laptop", "--robot", MINE),
    }
    assert certified.keys() == ROLES.keys()
    with site.router(certified["router of 001"]) as (secured, onboard), ExitStack() as closing:
        made = {"on board": zenoh.open(client_config(at(onboard)))}
        for role, member in certified.items():
            made[role] = zenoh.open(client_config(connecting(member, secured)))
        made["ros of 001"].close()
        made["ros of 001"] = zenoh.open(ros_config(site, secured))
        for session in made.values():
            closing.enter_context(session)
        yield made


def ros_config(site: Site, endpoint: str) -> zenoh.Config:
    """Return the configuration of a computer with ROS 2, from the printed override."""
    config = zenoh.Config()
    # As rmw_zenoh reads it: entries between semicolons, each a path and a JSON5 value.
    for entry in ros_override(str(site.folder / "ros.laptop"), endpoint).split(";"):
        config.insert_json5(*entry.split("=", 1))
    return config


def granted(role: str, verb: Verb, tried: tuple[str, ...] = KEYS) -> set[str]:
    """Return the keys on which the table grants a verb."""
    return {key for key in tried if may(ROLES[role], verb, key)}


@pytest.fixture
def came(sessions: Mapping[str, zenoh.Session]) -> Iterator[Came]:
    """What comes on board: keys and payloads."""
    found: Came = []
    subscribers = [
        sessions["on board"].declare_subscriber(
            key, lambda s: found.append((str(s.key_expr), s.payload.to_string()))
        )
        for key in EVERY
    ]
    yield found
    for each in subscribers:
        each.undeclare()


def put_until_it_comes(mine: zenoh.Session, key: str, text: str, came: Came) -> None:
    """Put on a key that is allowed: what was put before it has come, or was denied."""

    def passed() -> bool:
        mine.put(key, text, congestion_control=BLOCK)
        return (key, text) in came

    wait_until(passed, text)


def with_text(came: Came, text: str) -> set[str]:
    return {key for key, each in came if each == text}


@pytest.mark.parametrize("role", ROLES)
def test_write(sessions: Mapping[str, zenoh.Session], came: Came, role: str) -> None:
    mine, expected = sessions[role], granted(role, "write")
    put_until_it_comes(mine, min(expected), "begin", came)
    for key in KEYS:
        mine.put(key, role, congestion_control=BLOCK)
    put_until_it_comes(mine, min(expected), "end of puts", came)
    for key in KEYS:
        mine.delete(key, congestion_control=BLOCK)
    put_until_it_comes(mine, min(expected), "end of deletes", came)
    # Each subscriber has a thread of its own: the last put may overtake the others there.
    wait_until(lambda: with_text(came, role) >= expected, "each allowed put")
    wait_until(lambda: with_text(came, "") >= expected, "each allowed deletion")
    assert with_text(came, role) == with_text(came, "") == expected


@pytest.mark.parametrize("role", ROLES)
def test_read(sessions: Mapping[str, zenoh.Session], role: str) -> None:
    came: set[tuple[str, str]] = set()  # subscribed key and payload

    def receiver(key: str) -> Any:
        return lambda sample: came.add((key, sample.payload.to_string()))

    subscribers = [sessions[role].declare_subscriber(key, receiver(key)) for key in KEYS]
    onboard = sessions["on board"]

    def put_all(text: str) -> None:
        for key in KEYS:
            onboard.put(key, text, congestion_control=BLOCK)

    def received() -> set[str]:
        put_all("first")
        return {key for key, _ in came}

    wait_until(lambda: received() >= granted(role, "read"), "all that may be read")
    put_all("second")
    marker = min(granted(role, "read"))
    onboard.put(marker, "end", congestion_control=BLOCK)
    wait_until(lambda: (marker, "end") in came, "the last put")
    assert {key for key, _ in came} == granted(role, "read")
    for each in subscribers:
        each.undeclare()


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("verb", ["ask", "serve"])
def test_calls(sessions: Mapping[str, zenoh.Session], role: str, verb: Verb) -> None:
    onboard, mine = sessions["on board"], sessions[role]
    client, server = (mine, onboard) if verb == "ask" else (onboard, mine)
    served = [server.declare_queryable(key, partial(answer, key)) for key in PLAIN]
    expected = granted(role, verb, PLAIN)
    wait_until(lambda: asked(client, PLAIN) >= expected, "all that is allowed")
    assert asked(client, PLAIN) == expected
    for one in served:
        one.undeclare()


@pytest.mark.parametrize("role", ROLES)
def test_live(sessions: Mapping[str, zenoh.Session], role: str) -> None:
    wait_until(lambda: not alive(sessions["on board"]), "the end of other tests' tokens")
    tokens = [sessions[role].liveliness().declare_token(key) for key in PLAIN]
    expected = granted(role, "live", PLAIN)
    wait_until(lambda: alive(sessions["on board"]) >= expected, "all that may live")
    assert alive(sessions["on board"]) == expected
    for token in tokens:
        token.undeclare()


def answer(key: str, query: zenoh.Query) -> None:
    query.reply(key, b"yes")
    query.drop()


def asked(session: zenoh.Session, tried: tuple[str, ...]) -> set[str]:
    """Query all keys at the same time; return those with an answer."""
    answered: set[str] = set()
    ended = threading.Semaphore(0)

    def note(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            answered.add(str(reply.ok.key_expr))

    for key in tried:
        session.get(key, zenoh.handlers.Callback(note, ended.release), timeout=TIMEOUT_S)
    for _ in tried:
        assert ended.acquire(timeout=10 * TIMEOUT_S)
    return answered


def alive(session: zenoh.Session) -> set[str]:
    """Return the liveliness tokens visible to a session."""
    return {str(reply.ok.key_expr) for key in EVERY
            for reply in session.liveliness().get(key, timeout=TIMEOUT_S) if reply.ok}  # fmt: skip


@pytest.mark.parametrize(
    ("publisher", "subscriber"), [("on board", "viewer"), ("viewer", "on board")]
)
def test_late_subscribers_get_cached_events(
    sessions: Mapping[str, zenoh.Session], publisher: str, subscriber: str
) -> None:
    key = keys.EVENTS.on(MINE, service="dashboard")
    cache = zenoh.ext.CacheConfig(max_samples=10)
    published = zenoh.ext.declare_advanced_publisher(
        sessions[publisher], key, cache=cache, publisher_detection=True
    )
    published.put("kept")
    came: list[str] = []
    history = zenoh.ext.HistoryConfig(detect_late_publishers=True)
    for _ in range(5):  # a query may arrive before the declarations
        subscribed = zenoh.ext.declare_advanced_subscriber(
            sessions[subscriber],
            key,
            lambda s: came.append(s.payload.to_string()),
            history=history,
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
        )
        try:
            wait_until(lambda: came, "the event that is kept", TIMEOUT_S)
        except AssertionError:
            continue
        finally:
            subscribed.undeclare()
        break
    assert came[0] == "kept"
    published.undeclare()


# --- a member's own keys --------------------------------------------------------------------------


def test_a_declared_publisher_of_own_keys_is_read_by_all(
    sessions: Mapping[str, zenoh.Session],
) -> None:
    key = f"{keys.app_key(MINE, 'nav')}/route/state"
    came: list[str] = []
    subscribed = sessions["viewer"].declare_subscriber(
        f"{keys.ROOT}/{MINE}/**", lambda s: came.append(s.payload.to_string())
    )
    published: Any = sessions["driver of 001 as nav"].declare_publisher(
        key, congestion_control=BLOCK, encoding="image/jpeg"
    )
    wait_until(lambda: published.matching_status.matching, "the reader, at the publisher")
    for number in range(20):  # a publisher that may not know its readers sends one sample only
        published.put(str(number))
    wait_until(lambda: "19" in came, "the last sample")
    assert came == [str(number) for number in range(20)]
    published.undeclare()
    subscribed.undeclare()


def test_a_query_of_all_reaches_the_own_keys_of_each(
    sessions: Mapping[str, zenoh.Session],
) -> None:
    served = {}
    for name, role in (("nav", "driver of 001 as nav"), ("hall", "viewer")):
        key = f"{keys.app_key(MINE, name)}/plan"
        served[key] = sessions[role].declare_queryable(key, partial(answer, key))
    every = (f"{keys.app_key(MINE, '*')}/**",)

    def both(reader: str) -> bool:
        return asked(sessions[reader], every) == served.keys()

    for reader in ("on board", "driver of 001"):
        wait_until(partial(both, reader), f"both, at {reader}")
    for each in served.values():
        each.undeclare()


FOREIGN = (
    "t2/v1/*/app/**",
    "t2/v1/**",
    "t2/v1/001/app/**",
    "t2/v1/001/app/*/route",
    "t2/v1/001/app/n$*/route",
    "t2/v1/001/app/nav/**",
    "t2/v1/*/app/nav/route",
    "t2/v1/001/app/nav2/route",
    "t2/v1/001/app/nav/@cmd/route",
    "t2/v1/001/app/nav/1/2/3/4/5/6/7",
)


def test_own_keys_are_no_way_to_other_keys(
    sessions: Mapping[str, zenoh.Session], came: Came
) -> None:
    mine, own = sessions["driver of 001 as nav"], keys.app_key(MINE, "nav")
    put_until_it_comes(mine, own, "begin", came)
    for key in FOREIGN:
        mine.put(key, "foreign", congestion_control=BLOCK)
    put_until_it_comes(mine, own, "end", came)
    assert not with_text(came, "foreign")
