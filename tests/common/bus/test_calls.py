"""Calls over a real router: replies, refusals, and the texts without an answer."""

import time

import msgpack
import pytest

from common.bus.bus import Bus, Caller
from t2 import codec, keys
from t2.messages import Phrase, Refusal, ResetDone, ResetRequest
from tests.common.bus_fixture import BusFixture
from verification.harness.bus import at
from verification.harness.waiting import wait_until

FLOOD = 50  # queries
ARRIVES_S = 0.5
NO_ANSWER = "safety does not answer; run `t2 doctor`."
LATER = 9  # a cause whose reset is answered later
DONE = ResetDone(text="done")


class Server:
    """Serves resets, and keeps the callers that it has not answered."""

    def __init__(self) -> None:
        self.waiting: list[Caller[ResetDone]] = []
        self.requests: list[ResetRequest] = []
        self.refuses = ""

    def serve(self, bus: Bus) -> None:
        bus.serve(keys.RESET, self.take)

    def take(self, request: ResetRequest, caller: Caller[ResetDone]) -> None:
        self.requests.append(request)
        if self.refuses:
            caller.refuse(Phrase("call.invalid", {"reason": self.refuses}))
        elif LATER in request.causes:
            self.waiting.append(caller)
        else:
            caller.reply(DONE)


class Client:
    """Sends requests on a bus, and stores the answers."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.replies: list[ResetDone] = []
        self.refusals: list[str] = []

    @property
    def answers(self) -> int:
        return len(self.replies) + len(self.refusals)

    def send(self, *causes: int, timeout_s: float = 20.0) -> None:
        request = ResetRequest(causes=causes)

        def refused(refusal: Refusal) -> None:
            self.refusals.append(refusal.text)

        self.bus.call(keys.RESET, request, self.replies.append, refused, timeout_s)

    def asked(self, *causes: int, timeout_s: float = 20.0) -> "Client":
        """Send a request and wait for its answer."""
        count = self.answers
        self.send(*causes, timeout_s=timeout_s)
        wait_until(lambda: self.answers > count, "an answer")
        return self


@pytest.fixture
def server() -> Server:
    return Server()


@pytest.fixture
def client(buses: BusFixture, server: Server) -> Client:
    buses.bus(server.serve)
    client = Client(buses.bus())
    wait_until(lambda: client.asked().replies, "a reply: the router knows the server")
    client.replies.clear()
    client.refusals.clear()
    return client


@pytest.mark.parametrize("refusal", ["", "the bumper is pressed: 撞"])
def test_a_call_is_replied_to_or_refused_with_a_reason(
    client: Client, server: Server, refusal: str
) -> None:
    server.refuses = refusal
    client.asked()
    assert (client.replies, client.refusals) == (
        ([], [f"The message is invalid: {refusal}."]) if refusal else ([DONE], [])
    )


def test_a_flood_of_queries_is_answered_one_at_a_time(
    buses: BusFixture, client: Client, server: Server
) -> None:
    """Those that waited too long are dropped, the newest are answered."""
    server.requests.clear()
    with buses.stalled():
        for _ in range(FLOOD):
            client.send()
        time.sleep(ARRIVES_S)
    wait_until(lambda: client.answers == FLOOD, "an end of each query")
    assert 0 < len(client.replies) == len(server.requests) < FLOOD / 2
    assert set(client.refusals) == {NO_ANSWER}


def test_a_server_that_does_not_answer_in_time_is_named(client: Client, server: Server) -> None:
    assert client.asked(LATER, timeout_s=0.3).refusals == [NO_ANSWER]
    wait_until(lambda: server.waiting, "the request, however late")
    server.waiting.pop().reply(ResetDone(text="too late"))  # harmless: no caller receives it
    assert client.asked().replies == [DONE]


def test_the_routers_own_timeout_is_no_refusal(client: Client) -> None:
    # Both the calling session and the router have a timeout; either one may expire first.
    for _ in range(30):
        client.asked(LATER, timeout_s=0.02)
    assert set(client.refusals) == {NO_ANSWER}


def test_without_a_server_or_router_the_refusal_comes_at_once(buses: BusFixture) -> None:
    assert Client(buses.bus()).asked(timeout_s=600.0).refusals == [NO_ANSWER]
    never_opened = Client(Bus(at(buses.endpoint), buses.robot, buses.loop.post))
    assert never_opened.asked().refusals == ["Not connected to the robot."]


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (
            lambda query, key: query.reply(key, msgpack.packb({"text": 5})),
            "The message is invalid: not a ResetDone: ",
        ),
        (lambda query, _: query.reply_err("not with us"), "not with us"),  # without an encoding
    ],
)
def test_answers_of_others_are_refusals(buses: BusFixture, answer: object, reason: str) -> None:
    key = keys.RESET.on(buses.robot)
    queryable = buses.session().declare_queryable(key, lambda query: answer(query, key))  # type: ignore[operator]
    client = Client(buses.bus())

    def refused() -> bool:
        return any(text.startswith(reason) for text in client.asked().refusals)

    wait_until(refused, "the refusal")
    queryable.undeclare()
    assert client.replies == []


def test_an_undecodable_request_is_refused_with_its_fault(
    buses: BusFixture, server: Server, client: Client
) -> None:
    count = len(server.requests)
    (reply,) = buses.session().get(keys.RESET.on(buses.robot), payload=b"\xc1")
    assert reply.err is not None
    assert "not a ResetRequest: " in codec.refusal(reply.err.payload.to_bytes()).text
    assert len(server.requests) == count


def test_a_request_without_payload_is_one_of_defaults(
    buses: BusFixture, server: Server, client: Client
) -> None:
    (reply,) = buses.session().get(keys.RESET.on(buses.robot))
    assert reply.ok is not None
    assert msgpack.unpackb(reply.ok.payload.to_bytes())["text"] == "done"
    assert str(reply.ok.encoding) == "application/msgpack;t2.v1.ResetDone"
    assert server.requests[-1] == ResetRequest()
