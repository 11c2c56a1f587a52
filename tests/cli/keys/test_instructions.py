"""Instructions after an operation: next commands with actual paths."""

import subprocess

import msgspec
import pytest

from cli.keys import instructions
from cli.keys.profile import Profile, profile
from tests.cli.keys.site_fixture import member
from tools.docs import DOCS

ROBOT = profile("robot", "001", (), ())
SITE = profile("site", "berlin", (), ("site.example",))
ANNA = profile("driver", "anna", ("001", "002"), ())


@pytest.mark.parametrize(
    ("encrypted", "message"), [(False, "it is not encrypted"), (True, "it is encrypted")]
)
def test_a_new_authority(encrypted: bool, message: str) -> None:
    printed = "\n".join(instructions.authority_created("keys", "berlin", "2036-11-18", encrypted))
    assert "keys holds the certificate authority of site berlin, until 2036-11-18" in printed
    assert message in printed
    assert "t2 keys issue robot 001" in printed


def test_a_robots_certificate() -> None:
    printed = list(
        instructions.certificate_issued(
            ROBOT, member("robot", "001"), "keys/robot.001", [ROBOT, SITE]
        )
    )
    assert printed[0] == "robot.001.00000001, valid until 2027-09-17"
    assert "addresses 192.168.201.1, 10.7.5.220, localhost, 127.0.0.1" in printed[1]
    assert "     scp -rp keys/robot.001/. 192.168.201.1:/etc/t2/keys" in printed
    assert "     t2 router --config /etc/t2/keys/bus.toml" in printed
    assert (
        "     scp -p keys/members.json site.example:/etc/t2/keys/members.json  # site berlin"
        in printed
    )


def test_the_first_router_needs_no_list_update() -> None:
    printed = list(
        instructions.certificate_issued(ROBOT, member("robot", "001"), "keys/robot.001", [ROBOT])
    )
    assert not [line for line in printed if "members.json" in line]


def test_a_drivers_certificate() -> None:
    printed = list(
        instructions.certificate_issued(
            ANNA, member("driver", "anna"), "other/driver.anna", [ROBOT]
        )
    )
    assert "  may move robot 001, robot 002" in printed
    assert "     t2 drive --config driver.anna/bus.toml" in printed
    assert (
        "     scp -p other/members.json 192.168.201.1:/etc/t2/keys/members.json  # robot 001"
        in printed
    )


def test_a_drivers_sources() -> None:
    who = msgspec.structs.replace(member("driver", "anna"), sources=("nav",))
    printed = list(
        instructions.certificate_issued(
            Profile("driver", "anna", ("001",), (), ("nav",)), who, "k/d", []
        )
    )
    assert "  drives as nav; no other source is allowed" in printed
    assert "  may not reset, release or set the brake switches: no operator's source" in printed
    printed = list(
        instructions.certificate_issued(
            ANNA, member("driver", "anna"), "other/driver.anna", [ROBOT]
        )
    )
    assert not [line for line in printed if "drives as" in line]


def test_a_driver_of_every_robot() -> None:
    anna = msgspec.structs.replace(member("driver", "anna"), robots=("*",))
    who = Profile("driver", "anna", ("*",))
    assert "  may move every robot" in list(
        instructions.certificate_issued(who, anna, "keys/driver.anna", [])
    )


def test_a_viewers_certificate_without_routers() -> None:
    printed = list(
        instructions.certificate_issued(
            Profile("viewer", "v"), member("viewer", "v"), "viewer.v", []
        )
    )
    assert "     t2 dashboard --config viewer.v/bus.toml" in printed
    assert "3. Copy ./members.json to each router and restart it." in printed


def test_a_ros_computers_environment() -> None:
    site = [SITE, ROBOT]  # topics of ROS 2 do not pass a site's router
    laptop = profile("ros", "laptop", ("001",), ())
    printed = list(
        instructions.certificate_issued(laptop, member("ros", "laptop"), "keys/ros.laptop", site)
    )
    assert "  may move robot 001" in printed
    (line,) = (line.strip() for line in printed if "ZENOH_CONFIG_OVERRIDE" in line)
    shell = subprocess.run(
        ["sh", "-c", f'{line}; printf %s "$ZENOH_CONFIG_OVERRIDE"'],
        env={"PWD": "/home/anna"}, cwd="/", capture_output=True, text=True, check=True,
    )  # fmt: skip
    override = dict(part.split("=", 1) for part in shell.stdout.split(";"))
    assert override["mode"] == '"client"'
    assert override["connect/endpoints"] == '["tls/192.168.201.1:7447"]'
    assert override["transport/link/tls/connect_certificate"].endswith(
        '/ros.laptop/certificate.pem"'
    )


def test_the_previous_certificate() -> None:
    printed = list(
        instructions.certificate_renewed("driver", "anna", member("driver", "anna", "3f2a91bc", 10))
    )
    assert "until 2026-12-01" in printed[0]
    assert printed[1] == "     t2 keys revoke driver anna --serial 3f2a91bc"


def test_a_revocation_needs_every_router() -> None:
    printed = list(
        instructions.certificates_revoked([member("driver", "anna")], "keys/driver.anna", [ROBOT])
    )
    assert printed[0] == "driver.anna.00000001 is revoked"
    assert "takes effect when every router" in printed[1]
    assert printed[3].startswith("     scp -p keys/members.json ")


@pytest.mark.parametrize("routers", [[], [ROBOT]])
def test_a_router_in_a_container_needs_new_settings(routers: list[Profile]) -> None:
    printed = list(
        instructions.certificates_revoked([member("driver", "anna")], "keys/driver.anna", routers)
    )
    assert printed[-1].strip() == instructions.IN_CONTAINERS
    compose = (DOCS.parent / "compose.yaml").read_text(encoding="utf-8")
    for service in instructions.IN_CONTAINERS.partition("--force-recreate ")[2].split():
        assert f"\n  {service}:\n" in compose
    for page in ("docs/deploy.md", "docs/keys.md", "SECURITY.md"):
        assert instructions.IN_CONTAINERS in (DOCS.parent / page).read_text(encoding="utf-8"), page


def test_a_router_without_an_address_is_named() -> None:
    lost = Profile("robot", "002")
    printed = list(
        instructions.certificates_revoked(
            [member("driver", "anna")], "keys/driver.anna", [ROBOT, lost]
        )
    )
    assert (
        "     scp -p keys/members.json HOST:/etc/t2/keys/members.json"
        "  # robot 002; its address is not in the member list"
    ) in printed


def test_a_stolen_router_has_a_warning() -> None:
    printed = list(
        instructions.certificates_revoked([member("robot", "001")], "keys/robot.001", [])
    )
    assert printed[-1].startswith("Clients still accept")
