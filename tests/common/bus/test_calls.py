"""Calls over a real router: replies, refusals, and the words when nobody answers."""

import time

import msgpack
import pytest
import zenoh

from common import keys
from common.bus.bus import Bus
from common.bus.calls import Caller
from common.keys import info_key
from common.messages import Done, LedRequest, PoseRequest
from tests.common.bus_fixture import BusFixture, until_received
from verification.harness.bus import at
from verification.harness.waiting import wait_until

FLOOD = 50  # queries
ARRIVES_S = 0.5


class Server:
    """Serves the pose, and keeps whom it has not answered."""

    def __init__(self) -> None:
        self.waiting: list[Caller[Done]] = []
        self.asked: list[PoseRequest] = []
        self.refuses = ""

    def serve(self, bus: Bus) -> None:
        bus.serve(keys.SET_POSE, self.take)

    def take(self, request: PoseRequest, caller: Caller[Done]) -> None:
        self.asked.append(request)
        if self.refuses:
            caller.refuse(self.refuses)
        elif request.x == 0:
            caller.reply(Done(text="held"))
        else:
            self.waiting.append(caller)


class Client:
    """Sends requests on a bus, and stores the answers."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.replies: list[Done] = []
        self.refusals: list[str] = []

    @property
    def answers(self) -> int:
        return len(self.replies) + len(self.refusals)

    def request(self, *, held: bool = True, timeout_s: float = 20.0) -> None:
        self.bus.call(
            keys.SET_POSE,
            PoseRequest(x=0.0 if held else 1.0),
            self.replies.append,
            self.refusals.append,
            timeout_s,
        )

    def request_until_replied(self) -> None:
        """Repeat the request until the router knows the server."""

        def replied() -> bool:
            count = self.answers
            self.request()
            wait_until(lambda: self.answers > count, "an answer")
            return bool(self.replies)

        wait_until(replied, "a reply")
        self.replies.clear()
        self.refusals.clear()


@pytest.fixture
def server() -> Server:
    return Server()


@pytest.fixture
def client(buses: BusFixture, server: Server) -> Client:
    buses.bus(server.serve)
    client = Client(buses.bus())
    client.request_until_replied()
    return client


def test_a_call_is_replied_to(client: Client) -> None:
    client.request()
    wait_until(lambda: client.answers, "an answer")
    assert client.replies == [Done(text="held")]
    assert client.refusals == []


def test_a_flood_of_queries_is_answered_one_at_a_time(
    buses: BusFixture, client: Client, server: Server
) -> None:
    """Those that waited too long are dropped, the newest are answered."""
    server.asked.clear()
    with buses.stalled():
        for _ in range(FLOOD):
            client.request()
        time.sleep(ARRIVES_S)
    wait_until(lambda: client.answers == FLOOD, "an end of each query")
    assert 0 < len(client.replies) == len(server.asked) < FLOOD / 2
    assert set(client.refusals) == {"odom does not answer; run `t2 doctor`"}


def test_a_reply_may_come_later(client: Client, server: Server) -> None:
    client.request(held=False)
    wait_until(lambda: server.waiting, "the question")
    assert client.answers == 0
    server.waiting.pop().reply(Done(text="at last"))
    wait_until(lambda: client.answers, "an answer")
    assert client.replies == [Done(text="at last")]


def test_a_refusal_brings_its_reason(client: Client, server: Server) -> None:
    server.refuses = "the bumper is pressed: 撞"
    client.request()
    wait_until(lambda: client.answers, "an answer")
    assert client.refusals == ["the bumper is pressed: 撞"]
    assert client.replies == []


def test_who_does_not_answer_in_time_is_named(client: Client, server: Server) -> None:
    client.request(held=False, timeout_s=0.3)
    wait_until(lambda: client.answers, "the timeout")
    assert client.refusals == ["odom does not answer; run `t2 doctor`"]
    wait_until(lambda: server.waiting, "the question, however late")
    server.waiting.pop().reply(Done(text="too late"))  # harmless: no caller receives it
    client.request(timeout_s=20.0)
    wait_until(lambda: client.answers == 2, "the next answer")
    assert client.replies == [Done(text="held")]


def test_the_router_s_own_timeout_is_no_refusal(client: Client) -> None:
    # Both the calling session and the router have a timeout; either one may expire first.
    for count in range(1, 31):
        client.request(held=False, timeout_s=0.02)
        wait_until(lambda: client.answers == count, "the timeout")  # noqa: B023
    assert set(client.refusals) == {"odom does not answer; run `t2 doctor`"}


def test_a_refusal_needs_no_encoding(buses: BusFixture) -> None:
    def answer(query: zenoh.Query) -> None:
        query.reply_err("not with us")

    queryable = buses.session().declare_queryable(keys.SET_POSE.on(buses.robot), answer)
    client = Client(buses.bus())

    def refused() -> bool:
        client.request()
        return "not with us" in client.refusals

    wait_until(refused, "the refusal")
    queryable.undeclare()


def test_nobody_there_is_said_at_once(buses: BusFixture) -> None:
    client = Client(buses.bus())
    client.request(timeout_s=600.0)
    wait_until(lambda: client.answers, "an answer")
    assert client.refusals == ["odom does not answer; run `t2 doctor`"]


def test_no_router_is_said_at_once(buses: BusFixture) -> None:
    client = Client(Bus(at(buses.endpoint), buses.robot, buses.loop.post))  # never opened
    client.request()
    wait_until(lambda: client.answers, "an answer")
    assert client.refusals == ["not connected to a router"]


def test_a_reply_of_the_wrong_kind_is_a_refusal(buses: BusFixture) -> None:
    key = keys.SET_POSE.on(buses.robot)

    def answer(query: zenoh.Query) -> None:
        query.reply(key, msgpack.packb({"text": 5}))

    queryable = buses.session().declare_queryable(key, answer)
    client = Client(buses.bus())

    def refused() -> bool:
        client.request()
        return any(reason.startswith("not a Done: ") for reason in client.refusals)

    wait_until(refused, "the refusal")
    queryable.undeclare()
    assert client.replies == []


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"\xc1", "not a PoseRequest: "),
        (msgpack.packb({"x": "1"}), "Expected `float`, got `str` - at `$.x`"),
        (msgpack.packb({"hold": True}), "unknown field `hold`"),
        (b"\x91" * 100_000, "not a PoseRequest: "),
        (b"\x00" * 1_000_000, "not a PoseRequest: "),
    ],
    ids=["no msgpack", "wrong type", "unknown field", "deep", "big"],
)
def test_a_request_that_is_none_is_refused_with_its_fault(
    buses: BusFixture, server: Server, client: Client, payload: bytes, reason: str
) -> None:
    asked = len(server.asked)
    replies = list(buses.session().get(keys.SET_POSE.on(buses.robot), payload=payload))
    assert len(replies) == 1
    assert replies[0].err is not None
    assert reason in replies[0].err.payload.to_bytes().decode()
    assert len(server.asked) == asked


def test_a_request_without_payload_is_one_of_defaults(
    buses: BusFixture, server: Server, client: Client
) -> None:
    (reply,) = buses.session().get(keys.SET_POSE.on(buses.robot))
    assert reply.ok is not None
    assert msgpack.unpackb(reply.ok.payload.to_bytes()) == {"text": "held", "boot": 0}
    assert str(reply.ok.encoding) == "application/msgpack;t2.v1.Done"
    assert server.asked[-1] == PoseRequest()


def test_a_required_field_is_missed(buses: BusFixture) -> None:
    asked: list[LedRequest] = []
    bus = buses.bus(lambda bus: bus.serve(keys.SET_LED, lambda request, _: asked.append(request)))
    session = buses.session()

    def reasons() -> list[str]:
        replies = session.get(keys.SET_LED.on(buses.robot))
        return [reply.err.payload.to_bytes().decode() for reply in replies if reply.err]

    wait_until(lambda: any("missing required field `channel`" in said for said in reasons()), "it")
    assert asked == []
    assert bus.counters["undecodable"] >= 1


def test_any_query_on_an_answer_is_answered(buses: BusFixture) -> None:
    key = keys.info_key(buses.robot, "bridge", "schema")
    buses.bus(lambda bus: bus.answer(key, lambda: b'{"a": 1}', "application/json"))
    session = buses.session()

    def answers() -> list[zenoh.Sample]:
        replies = session.get(keys.info_key(buses.robot, "*", "*"))
        return [reply.ok for reply in replies if reply.ok]

    found: list[zenoh.Sample] = []
    until_received(lambda: found.extend(answers()), lambda: found, "an answer")
    assert found[0].payload.to_bytes() == b'{"a": 1}'
    assert str(found[0].key_expr) == key
    assert str(found[0].encoding) == "application/json"


def test_what_a_newcomer_asks_is_answered_as_it_stands(buses: BusFixture) -> None:
    buses.bus(
        lambda bus: bus.answer(info_key(buses.robot, "bridge", "config"), lambda: b"{}", "text")
    )
    client = buses.bus()
    answers: list[bytes] = []

    def once() -> bool:
        refusals: list[str] = []
        client.look_up("bridge", "config", answers.append, refusals.append)
        wait_until(lambda: answers or refusals, "an answer")
        return bool(answers)

    wait_until(once, "the bridge's answer")
    assert answers == [b"{}"]


def test_who_tells_nothing_is_named(buses: BusFixture) -> None:
    refusals: list[str] = []
    buses.bus().look_up("odom", "config", lambda _: None, refusals.append, timeout_s=0.3)
    wait_until(lambda: refusals, "the refusal")
    assert refusals == ["odom does not answer; run `t2 doctor`"]
