"""Robots, sites and a region, with the configuration of a site's router in ``docs/fleet.md``.

No installation uses it yet; this test verifies the statements about more than one site.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field

import pytest
import zenoh

from common import keys
from common.bus.session import client_config, router_config
from common.settings import BusSettings
from tests.common.bus_fixture import until_received
from verification.harness.bus import at, listening
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

# Additional settings of a site's router with the uplink to a region.
SITE: dict[str, object] = {
    "region_name": "site",
    "gateway": {"south": [{"filters": [{"region_names": ["robot"]}, {"modes": ["client"]}]}]},
}
SITES = ("berlin", "munich")
ROBOTS = tuple(f"{site}-00{number}" for site in SITES for number in (1, 2))


@dataclass
class Tree:
    """Sessions at the routers of the region, of berlin, and of each robot."""

    region: zenoh.Session
    berlin: zenoh.Session
    robots: Mapping[str, zenoh.Session]
    stops: set[str] = field(default_factory=set)


def routing(where: BusSettings, more: dict[str, object]) -> zenoh.Session:
    return zenoh.open(zenoh.Config.from_json5(json.dumps(router_config(where) | more)))


@pytest.fixture(scope="module")
def tree() -> Iterator[Tree]:
    region, *sites = (f"tcp/127.0.0.1:{free_port()}" for _ in range(1 + len(SITES)))
    by_name = dict(zip(SITES, sites, strict=True))
    with ExitStack() as stack:
        own = {}
        for name in ROBOTS:  # before the routers that they connect to
            own[name] = f"tcp/127.0.0.1:{free_port()}"
            uplink = by_name[name.partition("-")[0]]
            stack.enter_context(routing(listening(own[name], uplink), {}))
        for endpoint in sites:
            stack.enter_context(routing(listening(endpoint, region), SITE))
        stack.enter_context(routing(listening(region), {}))
        region_at, berlin_at, *robots_at = (
            stack.enter_context(zenoh.open(client_config(at(endpoint))))
            for endpoint in (region, by_name["berlin"], *own.values())
        )
        made = Tree(region_at, berlin_at, dict(zip(ROBOTS, robots_at, strict=True)))
        kept = [serve(made, name, session) for name, session in made.robots.items()]
        yield made
        assert kept


def serve(tree: Tree, name: str, session: zenoh.Session) -> object:
    """Declare what a robot serves."""
    reset = keys.RESET.on(name)
    return (
        session.liveliness().declare_token(keys.live_key(name, "safety", "1")),
        session.declare_queryable(reset, lambda query: query.reply(reset, b"done")),
        session.declare_subscriber(keys.estop_key(name), lambda _: tree.stops.add(name)),
    )


def test_the_region_sees_all_and_a_site_its_own(tree: Tree) -> None:
    seen: dict[str, set[str]] = {"region": set(), "berlin": set()}

    def note(where: str, sample: zenoh.Sample) -> None:
        seen[where].add(str(sample.key_expr).split("/")[2])

    every = keys.VELOCITY.on("*")
    subscribers = [
        tree.region.declare_subscriber(every, lambda sample: note("region", sample)),
        tree.berlin.declare_subscriber(every, lambda sample: note("berlin", sample)),
    ]

    def put() -> None:
        for name, session in tree.robots.items():
            session.put(keys.VELOCITY.on(name), b"")

    until_received(put, lambda: seen["region"] == set(ROBOTS), "all of them")
    until_received(put, lambda: len(seen["berlin"]) >= 2, "a site's own")
    assert seen["berlin"] == {name for name in ROBOTS if name.startswith("berlin")}
    for subscriber in subscribers:
        subscriber.undeclare()


def test_the_region_calls_each_robot(tree: Tree) -> None:
    def alive() -> set[str]:
        replies = tree.region.liveliness().get(keys.live_key("*", "*", "*"), timeout=2.0)
        return {str(reply.ok.key_expr).split("/")[2] for reply in replies if reply.ok}

    def answers(name: str) -> bool:
        return any(reply.ok for reply in tree.region.get(keys.RESET.on(name), timeout=2.0))

    wait_until(lambda: alive() == set(ROBOTS), "every token")
    wait_until(lambda: all(map(answers, ROBOTS)), "every answer")


@pytest.mark.parametrize("target", ["munich-$*", "*"])
def test_the_region_stops_one_site_or_all(tree: Tree, target: str) -> None:
    expected = {name for name in ROBOTS if target == "*" or name.startswith("munich")}
    tree.stops.clear()
    until_received(
        lambda: tree.region.put(keys.estop_key(target), b""),
        lambda: tree.stops >= expected,
        "all stops",
    )
    assert tree.stops == expected
