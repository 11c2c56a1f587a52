"""Three simulated robots, each with its own session to the site."""

import subprocess
from collections import Counter

from common import keys
from tests.cli.processes import ran, sets
from verification.fleet.simulated_robot import recorded
from verification.fleet.streams import downsampling, schedule
from verification.fleet.topology import simulated_robots, site


def test_every_stream_has_its_rate() -> None:
    streams = recorded()
    paths = [stream.path for stream in streams]
    assert len(set(paths)) == len(paths)
    topics = {topic for topic in keys.TOPICS if topic.path.startswith("tel/")}
    assert {stream.topic for stream in streams} == topics
    slots = schedule(streams, 3)
    assert all(0 <= at_s < 1 for at_s, _, _ in slots)
    counts = Counter((robot, number) for _, robot, number in slots)
    assert counts == {
        (robot, number): stream.topic.rate_hz
        for robot in range(3)
        for number, stream in enumerate(streams)
    }


def test_slow_streams_are_not_downsampled() -> None:
    (settings,) = downsampling("berlin-001", recorded(), 10.0)
    rules = settings["rules"]
    assert isinstance(rules, list)
    assert {rule["freq"] for rule in rules} == {10.0}
    limited = {rule["key_expr"] for rule in rules}
    assert keys.ODOMETRY.on("berlin-001") in limited
    assert keys.LINK.on("berlin-001") not in limited


def test_simulated_robots_are_listed_and_stopped() -> None:
    with site() as fleet, simulated_robots(fleet, 3, "peer", 0.0):
        assert fleet.simulated
        where = sets(f"bus.connect={fleet.site}")
        listed = ran("robots", "--site", "berlin", "--text", *where)
        assert listed.returncode == 0, listed.stderr
        names = ["berlin-001", "berlin-002", "berlin-003"]
        assert [line.split()[0] for line in listed.stdout.splitlines()[1:]] == names
        done = _stop(where)
        assert [line.split()[1] for line in done.stdout.splitlines()] == names
        fleet.simulated.begin()
        counts = fleet.simulated.end()
    assert counts["stopped"] == 3


def _stop(where: list[str]) -> "subprocess.CompletedProcess[str]":
    done = ran("estop", "--site", "berlin", *where)
    assert (done.returncode, done.stderr) == (0, "")
    return done
