"""Order of the calls that wait for the fleet's thread, and a full queue."""

from services.dashboard.websocket_hub import CALLS_MAX, Call, CallQueue, Inbox


def test_an_emergency_stop_is_made_before_waiting_calls() -> None:
    posted: list[Call] = []
    made: list[str] = []
    inbox, queue = Inbox(posted.append), CallQueue()
    for name in ("first", "second"):
        inbox.put(queue, lambda name=name: made.append(name))  # type: ignore[misc]
    inbox.stop("001", lambda: made.append("stop"))
    for call in posted:
        call()
    assert made == ["stop", "first", "second"]


def test_waiting_stops_of_one_robot_are_merged() -> None:
    posted: list[Call] = []
    made: list[str] = []
    inbox = Inbox(posted.append)
    for robot in ("001", "001", "002"):
        inbox.stop(robot, lambda robot=robot: made.append(robot))  # type: ignore[misc]
    for call in posted:
        call()
    assert sorted(made) == ["001", "002"]
    inbox.stop("001", lambda: made.append("again"))
    posted[-1]()
    assert made[-1] == "again"


def test_a_queue_is_bounded() -> None:
    inbox, queue = Inbox(lambda _: None), CallQueue()
    for _ in range(CALLS_MAX):
        assert not queue.is_full
        inbox.put(queue, lambda: None)
    assert queue.is_full
