"""Upgrade and rollback of one service while the others run."""

import json

from verification.containers.crashes import stop
from verification.containers.engine import Project, docker
from verification.containers.stack_fixture import SERVICES, StackFixture
from verification.harness.waiting import wait_until

ONE = "odom"


def one_service_is_upgraded(fixture: StackFixture) -> str:
    """Change the image of one service; the others keep their containers, and driving works."""
    old = fixture[ONE].about
    tag = f"{old['Config']['Image']}-next"
    build(old["Config"]["Image"], tag)
    newer = replaced(fixture, tag)
    seen = [changed(fixture, newer), changed(fixture, fixture.project)]
    assert fixture[ONE].about["Image"] == old["Image"], "no rollback"
    return f"only {ONE} was recreated, upgrade and rollback: {' '.join(seen)}"


def changed(fixture: StackFixture, project: Project) -> str:
    """Start the service of this project while the vehicle stands; return its image."""
    stop(fixture)
    before = {name: (fixture[name].id, fixture[name].began) for name in SERVICES}
    project("up", "-d", "--no-deps", "--no-build", ONE)
    after = {name: (fixture[name].id, fixture[name].began) for name in SERVICES}
    others = {name for name in SERVICES if before[name] != after[name]}
    assert others == {ONE}, others
    fixture.wait_healthy(ONE)
    fixture.driver.odometry = None
    wait_until(lambda: fixture.driver.odometry, "odometry")
    fixture.driver.push(fixture.speed)
    stop(fixture)
    return str(fixture[ONE].about["Image"])[7:19]


def build(old: str, new: str) -> None:
    """Create an image that differs only in a label."""
    container = docker("create", old)
    docker("commit", "--change", "LABEL t2.version=next", container, new)
    docker("rm", container)


def replaced(fixture: StackFixture, image: str) -> Project:
    """Return the project with another image for the service."""
    project = fixture.project
    file = project.files[-1].parent / "next.json"
    file.write_text(json.dumps({"services": {ONE: {"image": image}}}), encoding="utf-8")
    return Project(project.name, [*project.files, file], project.variables, project.profiles)
