"""Settings file of a machine."""

import tomllib
from pathlib import Path

import pytest

from cli.keys.machine_settings import SOCKET, bus_toml
from cli.keys.member_list import profile
from cli.keys.members import OPERATORS_SOURCES, Profile
from cli.settings import Everything
from common.config import Sources, load
from common.settings import Shared

ROBOT = profile("robot", "001")
OTHER = profile("robot", "002", (), ("robot-2.lan", "fd00::2"))
SITE = profile("site", "berlin", (), ("site.example",))
ANNA = profile("driver", "anna", ("001",), ())
FILES = {"ca": "ca.pem", "certificate": "certificate.pem", "private_key": "private.key"}


def test_a_router_listens_on_socket_and_tls() -> None:
    bus = {"listen": [SOCKET, "tls/0.0.0.0:7447"], "members": "members.json", **FILES}
    assert tomllib.loads(bus_toml(ROBOT, [OTHER])) == {"robot": {"id": "001"}, "bus": bus}
    assert tomllib.loads(bus_toml(SITE, [ROBOT])) == {"bus": bus}  # without a robot's id
    uplink = {"uplink": ["tls/site.example:7447"]}
    assert tomllib.loads(bus_toml(ROBOT, [OTHER, SITE]))["bus"] == bus | uplink


@pytest.mark.parametrize(
    ("who", "routers", "endpoints"),
    [
        (ANNA, [ROBOT, OTHER], ["tls/192.168.201.1:7447", "tls/10.7.5.220:7447"]),
        (ANNA, [profile("site", "x", (), ("127.0.0.1",))], ["tls/localhost:7447"]),
        (ANNA, [ROBOT, SITE], ["tls/site.example:7447"]),
        (
            Profile(role="driver", name="b", robots=("*",), sources=OPERATORS_SOURCES),
            [OTHER],
            ["tls/robot-2.lan:7447", "tls/[fd00::2]:7447"],
        ),
    ],
)
def test_other_members_connect(who: Profile, routers: list[Profile], endpoints: list[str]) -> None:
    text = bus_toml(who, routers)
    table = tomllib.loads(text)
    assert table["bus"] == {"connect": endpoints[:1], **FILES}
    assert table.get("robot") == ({"id": "001"} if who is ANNA else None)
    assert [line for line in text.splitlines() if line.startswith("# or: ")] == [
        f'# or: connect = ["{other}"]' for other in endpoints[1:]
    ]


@pytest.mark.parametrize(
    ("sources", "expected"),
    [
        ((), {}),
        (("teleop",), {"dashboard": {"source": "teleop"}}),
        (("nav", "x"), {"teleop": {"source": "nav"}, "dashboard": {"source": "nav"}}),
    ],
)
def test_screens_use_an_allowed_source(
    sources: tuple[str, ...], expected: dict[str, object], tmp_path: Path
) -> None:
    who = Profile(role="driver", name="b", robots=("001",), sources=sources)
    table = tomllib.loads(bus_toml(who, [ROBOT]))
    assert {name: table[name] for name in table if name in ("teleop", "dashboard")} == expected
    file = tmp_path / "bus.toml"
    file.write_text(bus_toml(who, [ROBOT]))
    config = load(Everything, Sources(files=(file,))).config
    assert config.teleop.source == (sources[0] if "teleop" in expected else "teleop")
    load(Shared, Sources(files=(file,)))  # other programs accept it
