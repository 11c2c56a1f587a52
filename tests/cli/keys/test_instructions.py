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
NAV = certified(profile("driver", "anna", ("*",), sources=("nav",)))
LIDAR = certified(profile("device", "lidar", ("001",), sources=("lidar",)))
VIEWER = certified(profile("viewer", "v"))
LAPTOP = certified(profile("ros", "laptop", ("001",)))


@pytest.mark.parametrize(
    ("encrypted", "message"), [(False, "it is not encrypted"), (True, "it is encrypted")]
)
def test_a_new_authority(encrypted: bool, message: str) -> None:
    printed = "\n".join(instructions.authority_created("keys", "berlin", "2036-11-18", encrypted))
    assert "keys holds the certificate authority of site berlin, until 2036-11-18" in printed
    assert message in printed
    assert "t2 keys issue robot 001" in printed


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
            "  may move robot 001, robot 002",
            "     t2 drive --config driver.anna/bus.toml",
            "     scp -p other/members.json 192.168.201.1:/etc/t2/keys/members.json  # robot 001",
        ]),
        (NAV, "k/d", [], [
            "  may move every robot",
            "  drives as nav; no other source is allowed",
            "  may not reset, release or set the brake switches: no operator's source",
        ]),
        (LIDAR, "k/d", [ROBOT], [
            "  limits robot 001 as lidar; no other source is allowed",
            "     t2 doctor --config d/bus.toml",
        ]),
        (VIEWER, "viewer.v", [], [
            "     t2 dashboard --config viewer.v/bus.toml",
            "3. Copy ./members.json to each router and restart it.",
        ]),
        (LAPTOP, "keys/ros.laptop", [SITE, ROBOT], ["  may move robot 001"]),
    ],
)  # fmt: skip
def test_an_issued_certificate(
    who: Member, target: str, routers: list[Member], lines: list[str]
) -> None:
    printed = list(instructions.certificate_issued(who, target, routers))
    for line in lines:
        assert line in printed, printed
    assert any("drives as" in line for line in printed) is (who is NAV)


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


def test_the_previous_certificate() -> None:
    printed = list(instructions.certificate_renewed(member("driver", "anna", "3f2a91bc", 10)))
    assert "until 2026-12-01" in printed[0]
    assert printed[1] == "     t2 keys revoke driver anna --serial 3f2a91bc"


@pytest.mark.parametrize("routers", [[], [ROBOT]])
def test_a_revocation_needs_every_router(routers: list[Member]) -> None:
    printed = list(instructions.certificates_revoked([ANNA], "keys/driver.anna", routers))
    assert printed[0] == "driver.anna.00000001 is revoked"
    assert "takes effect when every router" in printed[1]
    copies = [line for line in printed if line.startswith("     scp -p keys/members.json ")]
    assert len(copies) == len(routers)
    assert printed[-1].strip() == instructions.IN_CONTAINERS


def test_a_router_in_a_container_needs_new_settings() -> None:
    compose = (DOCS.parent / "compose.yaml").read_text(encoding="utf-8")
    for service in instructions.IN_CONTAINERS.partition("--force-recreate ")[2].split():
        assert f"\n  {service}:\n" in compose


def test_a_stolen_router_has_a_warning() -> None:
    printed = list(instructions.certificates_revoked([ROBOT], "keys/robot.001", []))
    assert printed[-1].startswith("Clients still accept")
