"""Members of the bus, from tokens and the router's admin space."""

from typing import Any

from cli.inspect.members import Member, by_boot, members, title

TOKENS = ["t2/v1/7/live/bridge/1a", "t2/v1/7/live/safety/2b", "t2/v1/7/live/odd"]


def entry(role: str, key: str, *zids: str) -> tuple[str, Any]:
    return f"@/r0/router/{role}/{key}", {"routers": ["r0"], "peers": ["p0"], "clients": list(zids)}


DECLARED = dict(
    [
        entry("token", "t2/v1/7/live/bridge/1a", "zb"),
        entry("token", "t2/v1/7/live/safety/2b", "zs"),
        entry("token", "t2/v1/7/live/other/3c", "zx"),
        entry("publisher", "t2/v1/7/tel/bridge/bumper", "zb"),
        entry("subscriber", "t2/v1/7/tel/bridge/bumper", "zs", "me"),
        entry("subscriber", "t2/v1/7/tel/**", "stranger-1"),
        entry("queryable", "t2/v1/7/srv/safety/reset", "zs"),
        entry("queryable", "t2/v1/7/evt/safety/@adv/pub/x", "zs"),
        ("@/r0/router", {"version": "v1"}),
        ("@/r0/router/linkstate/x", "graph {}"),
    ]
)  # fmt: skip


def test_services_have_names_and_other_sessions_ids() -> None:
    bridge, safety, other = members(TOKENS, DECLARED, without=("me",))
    assert (bridge.name, bridge.robot, bridge.instance, bridge.zid) == ("bridge", "7", "1a", "zb")
    assert bridge.publishes == {"t2/v1/7/tel/bridge/bumper"}
    assert safety.reads == {"t2/v1/7/tel/bridge/bumper"}
    assert safety.answers == {"t2/v1/7/srv/safety/reset"}
    assert (other.name, other.instance) == ("stranger", "")


def test_tokens_are_enough_without_the_admin_space() -> None:
    assert [each.name for each in members(TOKENS, {})] == ["bridge", "safety"]


def test_members_of_one_name_have_unique_titles() -> None:
    two = [Member("safety", robot="7", instance=each) for each in ("aaaa1", "bbbb2")]
    assert [title(each, two) for each in two] == ["safety:aaaa", "safety:bbbb"]
    assert title(two[0], [two[0], Member("safety", robot="8", instance="cc")]) == "safety"


def test_services_by_boot() -> None:
    found = [*members(TOKENS, DECLARED), Member("x", instance="no number")]
    assert {boot: member.name for boot, member in by_boot(found).items()} == {
        0x1A: "bridge",
        0x2B: "safety",
    }
