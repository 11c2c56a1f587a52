"""Instructions after an operation: next commands with actual paths."""

import subprocess

import pytest

from cli.keys import instructions
from cli.keys.member_list import profile
from common.members import Member
from tests.cli.keys.site_fixture import certified, member
from tools.docs import DOCS

ROBOT = certified(profile("robot", "001"))
SITE = certified(profile("site", "berlin", addresses=("site.example",)))
ANNA = certified(profile("driver", "anna", ("001", "002")))
NAV = certified(profile("driver", "nav", ("*",), sources=("nav",)))
VIEWER = certified(profile("viewer", "v"))
LAPTOP = certified(profile("ros", "laptop", ("001",)))


@pytest.mark.parametrize(
    ("who", "target", "routers", "lines"),
    [
        (ROBOT, "keys/robot.001", [ROBOT, SITE], [
            "robot.001.00000001, valid until 2027-09-17",
            "  addresses 192.168.201.1, 10.7.5.220, localhost, 127.0.0.1; valid at no other"
            " address",
            "     scp -rp keys/robot.001/. 192.168.201.1:/etc/t2/keys",
            "     t2 router --config /etc/t2/keys/bus.toml",
            "     scp -p keys/members.json site.example:/etc/t2/keys/members.json  # site berlin",
        ]),
        (ANNA, "other/driver.anna", [ROBOT], [
            "  for robots 001, 002",
            "     t2 doctor --config driver.anna/bus.toml",
            "     scp -p other/members.json 192.168.201.1:/etc/t2/keys/members.json  # robot 001",
        ]),
        (NAV, "k/d", [], [
            "  for robots all as nav only",
            "  may not reset, release or set the brake switches: no operator's source",
        ]),
        (VIEWER, "viewer.v", [], ["2. Copy ./members.json to each router and restart it:"]),
    ],
)  # fmt: skip
def test_an_issued_certificate(
    who: Member, target: str, routers: list[Member], lines: list[str]
) -> None:
    printed = list(instructions.certificate_issued(who, target, routers))
    for line in lines:
        assert line in printed, printed


def test_the_first_router_needs_no_list_update() -> None:
    printed = list(instructions.certificate_issued(ROBOT, "keys/robot.001", [ROBOT]))
    assert not [line for line in printed if "members.json" in line]


def test_a_ros_computers_environment() -> None:
    # Topics of ROS 2 do not pass a site's router.
    printed = instructions.certificate_issued(LAPTOP, "keys/ros.laptop", [SITE, ROBOT])
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


def test_after_a_renewal_and_a_revocation() -> None:
    printed = list(instructions.certificate_renewed(member("driver", "anna", "3f2a91bc", 10)))
    assert printed[1] == "     t2 keys revoke driver anna --serial 3f2a91bc"
    revoked = list(instructions.certificates_revoked([ANNA], "keys/driver.anna", [ROBOT]))
    assert revoked[0] == "driver.anna.00000001 is revoked"
    assert any(line.startswith("     scp -p keys/members.json ") for line in revoked)
    (_, *_, warning) = instructions.certificates_revoked([ROBOT], "keys/robot.001", [])
    assert warning.startswith("Clients still accept")
    compose = (DOCS.parent / "compose.yaml").read_text(encoding="utf-8")
    for service in instructions.IN_CONTAINERS.partition("--force-recreate ")[2].split():
        assert f"\n  {service}:\n" in compose
