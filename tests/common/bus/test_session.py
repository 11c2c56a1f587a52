"""How a client finds its router, early or late, and the router itself."""

import json
import socket
from pathlib import Path

import pytest
import zenoh

from common import settings
from common.bus.bus import Arrival, Bus
from common.bus.inspector import inspecting
from common.bus.session import (
    CLIENT_MAX,
    ROUTER_MAX,
    client_config,
    downsampling_rules,
    router,
    router_config,
)
from t2 import keys
from t2.errors import LinkError
from t2.messages import Bumper, Event, ResetDone, ResetRequest
from tests.common.bus_fixture import BusFixture, until_received
from verification.harness.bus import at, listening, router_process
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


def nowhere() -> str:
    """Return an endpoint where nobody listens."""
    return f"tcp/127.0.0.1:{free_port()}"


def test_a_router_behind_one_that_is_silent_is_found(buses: BusFixture) -> None:
    where = nowhere()
    with socket.create_server(("127.0.0.1", 0)) as silent, router(listening(where)):
        dead = f"tcp/127.0.0.1:{silent.getsockname()[1]}"
        bus = Bus(at(dead, where), buses.robot, buses.loop.post)
        bus.open()
        wait_until(lambda: bus.connected, "the second one")
        bus.close()
        with inspecting(at(dead, where)) as opened:
            assert opened.zid


def test_a_router_that_comes_later_or_again_finds_all_as_it_was(buses: BusFixture) -> None:
    buses.endpoint = nowhere()
    received: list[Arrival[Bumper]] = []
    seen: list[str] = []
    replies: list[ResetDone] = []
    late: list[str] = []
    receiver, sender = (Bus(at(buses.endpoint), buses.robot, buses.loop.post) for _ in "ab")
    receiver.subscribe(keys.BUMPER, received.append)
    receiver.subscribe(keys.EVENTS, lambda a: late.append(a.message.name), depth=99, service="*")
    receiver.serve(keys.RESET, lambda _, caller: caller.reply(ResetDone(text="done")))
    receiver.watch_live(keys.live_key(buses.robot, "*", "*"), lambda key, _: seen.append(key))
    sender.live(keys.live_key(buses.robot, "bridge", "1"))
    bumper = sender.publisher(keys.BUMPER)
    events = sender.publisher(keys.EVENTS, service="bridge")
    receiver.open()
    sender.open()
    buses.loop.post(lambda: buses.loop.every(0.01, lambda _: receiver.answer_queries()))
    connections = []
    for _ in range(2):
        with router(listening(buses.endpoint)):
            wait_until(lambda: receiver.connected and sender.connected, "both sessions")
            connections.append(receiver.connection)
            until_received(lambda: bumper.put(Bumper(pressed=True)), lambda: received, "a bumper")
            wait_until(lambda: seen, "the token")
            until_received(
                lambda: events.put(Event(name="stop", level="info", text="")),
                lambda: late,
                "an event",
            )
            until_received(
                lambda: sender.call(keys.RESET, ResetRequest(), replies.append, print),
                lambda: replies,
                "a reply",
            )
        wait_until(lambda: not (receiver.connected or sender.connected), "the router's end")
        bumper.put(Bumper(pressed=True))  # harmless
        for some in (received, seen, replies, late):
            some.clear()
    assert 0 < connections[0] < connections[1]
    receiver.close()
    sender.close()


def test_closing_waits_for_no_router() -> None:
    never_opened, looking = (Bus(at(nowhere()), "001", lambda call: call()) for _ in "ab")
    never_opened.close()
    looking.open()
    looking.close()
    assert not looking.sessions[0]._thread.is_alive()


def test_a_taken_port_is_a_link_error() -> None:
    where = nowhere()
    with (
        router(listening(where)),
        pytest.raises(LinkError, match=f"^the router cannot listen on {where}: ") as caught,
        router(listening(where)),
    ):
        raise AssertionError("two routers on one port")
    assert "/root/" not in str(caught.value)


def test_a_router_on_a_unix_socket(buses: BusFixture, tmp_path: Path) -> None:
    buses.endpoint = f"unixsock-stream/{tmp_path}/made/bus.sock"
    received: list[Arrival[Bumper]] = []
    with router(listening(buses.endpoint)):
        receiver = buses.bus(lambda bus: bus.subscribe(keys.BUMPER, received.append))
        sender = buses.bus().publisher(keys.BUMPER)
        until_received(lambda: sender.put(Bumper(pressed=True)), lambda: received, "a bumper")
        receiver.close()


def test_a_larger_message_is_dropped_and_its_link_stays() -> None:
    endpoint = nowhere()
    outside = {"mode": "client", "connect": {"endpoints": [endpoint]}}
    outside |= {"scouting": {"multicast": {"enabled": False}}}
    plain = zenoh.Config.from_json5(json.dumps(outside))
    with (
        router_process(endpoint) as process,
        zenoh.open(client_config(at(endpoint))) as ours,
        zenoh.open(plain) as sender,
        zenoh.open(plain) as plain_reader,
    ):
        received: list[int] = []
        forwarded: list[int] = []
        kept = (
            ours.declare_subscriber("x", lambda sample: received.append(len(sample.payload))),
            plain_reader.declare_subscriber("x", lambda got: forwarded.append(len(got.payload))),
        )
        fits, forwarded_only = CLIENT_MAX - 1000, (CLIENT_MAX + 1000, ROUTER_MAX - 1000)
        block = zenoh.CongestionControl.BLOCK

        def put(size: int, *sizes: list[int]) -> None:
            """Put until these have it: a busy router drops large messages."""
            until_received(
                lambda: sender.put("x", bytes(size), congestion_control=block),
                lambda: all(size in each for each in sizes),
                f"{size} bytes",
            )

        put(1, received, forwarded)
        links = sender.info.zid(), [str(zid) for zid in sender.info.routers_zid()]
        put(fits, received, forwarded)
        for size in forwarded_only:
            put(size, forwarded)
        for size in (ROUTER_MAX + 1000, 10**8):
            sender.put("x", bytes(size), congestion_control=block)
        put(2, received, forwarded)
        assert set(received) == {1, fits, 2}
        assert set(forwarded) == {1, fits, *forwarded_only, 2}
        assert links == (sender.info.zid(), [str(zid) for zid in sender.info.routers_zid()])
        status = Path(f"/proc/{process.pid}/status").read_text("utf-8")
        assert int(status.partition("VmHWM:")[2].split()[0]) < 150_000  # kB
        del kept


# --- downsampling for laptops -------------------------------------------------------------------


def rules(rate_hz: float) -> dict[str, float]:
    (egress,) = downsampling_rules("007", rate_hz)
    return {rule["key_expr"]: rule["freq"] for rule in egress["rules"]}


@pytest.mark.parametrize(
    ("wanted_hz", "every"), [(10.0, 5), (5.0, 10), (12.0, 5), (25.0, 2), (49.0, 2)]
)
def test_every_nth_sample_passes_early_or_late_by_less_than_half(
    wanted_hz: float, every: int
) -> None:
    held_s = 1 / rules(wanted_hz)[keys.BUMPER.on("007")]
    assert (every - 1) / 50 < held_s < every / 50


def test_a_robots_router_downsamples_fast_streams_towards_laptops_and_nothing_on_board() -> None:
    fast = {t.on("007") for t in keys.TOPICS if t.service is keys.FAST and t.rate_hz > 10}
    pictures = keys.PICTURE.on("007", camera="*")  # at any rate of the others
    assert set(rules(10.0)) == {*fast, keys.MOTION.on("007"), pictures}
    assert rules(50.0) == {pictures: 2.0}
    config = router_config(settings.BusSettings(), robot="007")
    zenoh.Config.from_json5(json.dumps(config))  # refuses unknown fields
    (egress,) = downsampling_rules("007", settings.BusSettings().laptop_rate)
    assert config["downsampling"] == [egress]
    assert (egress["flows"], egress["messages"]) == (["egress"], ["put"])
    assert egress["link_protocols"] == ["tls", "quic"]
    assert "downsampling" not in router_config(settings.BusSettings())
