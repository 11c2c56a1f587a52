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


def printed(member: Member, *routers: Member) -> str:
    return "\n".join(instructions.certificate_issued(member, "keys/x", routers))


def test_the_first_router_needs_no_list_update() -> None:
    assert "members.json" not in printed(ROBOT, ROBOT)


def test_a_restart_that_latches_is_announced() -> None:
    assert all("latches its vehicle" in printed(each, ROBOT) for each in (ROBOT, VIEWER, SITE))
    assert not any("latches its vehicle" in printed(each, SITE) for each in (VIEWER, SITE))
    revoked = instructions.certificates_revoked([VIEWER], "keys/viewer.hall", [ROBOT])
    assert "latches its vehicle" in "\n".join(revoked)


def test_a_ros_computers_environment() -> None:
    # Topics of ROS 2 do not pass a site's router.
    lines = instructions.certificate_issued(LAPTOP, "keys/ros.laptop", [SITE, ROBOT])
    (line,) = (line.strip() for line in lines if "ZENOH_CONFIG_OVERRIDE" in line)
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
