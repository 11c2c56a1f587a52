"""Instructions after an operation: next commands with actual paths."""

import subprocess

from cli.keys import instructions
from cli.keys.member_list import profile
from cli.keys.members import Member
from tests.cli.keys.site_fixture import certified
from tools.docs import DOCS

ROBOT = certified(profile("robot", "001"))
SITE = certified(profile("site", "berlin", addresses=("site.example",)))
VIEWER = certified(profile("viewer", "hall"))
LAPTOP = certified(profile("ros", "laptop", ("001",)))


def test_the_first_router_needs_no_list_update() -> None:
    printed = list(instructions.certificate_issued(ROBOT, "keys/robot.001", [ROBOT]))
    assert not [line for line in printed if "members.json" in line]


def test_a_restart_that_latches_is_announced() -> None:
    def announced(member: Member, *routers: Member) -> bool:
        printed = "\n".join(instructions.certificate_issued(member, "keys/x", routers))
        return "latches its vehicle" in printed

    assert announced(ROBOT)
    assert announced(VIEWER, ROBOT)
    assert announced(SITE, ROBOT)
    assert not announced(VIEWER, SITE)
    assert not announced(SITE)
    assert "latches its vehicle" in "\n".join(
        instructions.certificates_revoked([VIEWER], "keys/viewer.hall", [ROBOT])
    )


def test_the_own_keys_are_named() -> None:
    printed = [
        list(instructions.certificate_issued(each, "keys/x", [])) for each in (VIEWER, ROBOT)
    ]
    assert "  may publish keys of its own: app/hall/**" in printed[0]
    assert not [line for line in printed[1] if "app/" in line]


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


def test_the_services_of_containers_exist() -> None:
    compose = (DOCS.parent / "compose.yaml").read_text(encoding="utf-8")
    for service in instructions.IN_CONTAINERS.partition(" restart ")[2].split():
        assert f"\n  {service}:\n" in compose
