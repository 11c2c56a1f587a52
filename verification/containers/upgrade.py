"""One service gets a new version, and goes back, while the others go on."""

import json

from verification.containers.crashes import stop
from verification.containers.engine import Project, docker
from verification.containers.stack_fixture import SERVICES, Stage
from verification.harness.waiting import wait_until

ONE = "odom"


def one_service_is_upgraded(stage: Stage) -> str:
    """A new image for one service; the others keep their containers, and it drives after."""
    old = stage[ONE].about
    tag = f"{old['Config']['Image']}-next"
    build(old["Config"]["Image"], tag)
    newer = replaced(stage, tag)
    seen = [changed(stage, newer), changed(stage, stage.project)]
    assert stage[ONE].about["Image"] == old["Image"], "it did not go back"
    return f"only {ONE} was made anew, there and back: {' '.join(seen)}"


def changed(stage: Stage, project: Project) -> str:
    """Bring the one up as this project has it, while the vehicle stands; return its image."""
    stop(stage)
    before = {name: (stage[name].id, stage[name].began) for name in SERVICES}
    project("up", "-d", "--no-deps", "--no-build", ONE)
    after = {name: (stage[name].id, stage[name].began) for name in SERVICES}
    others = {name for name in SERVICES if before[name] != after[name]}
    assert others == {ONE}, others
    stage.wait_well(ONE)
    seen = stage.wheel.driver.odometry[-1].boot
    wait_until(lambda: stage.wheel.driver.odometry[-1].boot == seen, "odometry is heard")
    stage.wheel.push(stage.speed)
    stop(stage)
    return str(stage[ONE].about["Image"])[7:19]


def build(old: str, new: str) -> None:
    """Make an image that differs from an old one in a label alone."""
    container = docker("create", old)
    docker("commit", "--change", "LABEL t2.version=next", container, new)
    docker("rm", container)


def replaced(stage: Stage, image: str) -> Project:
    """Return the project with another image for the one service."""
    project = stage.project
    file = project.files[-1].parent / "next.json"
    file.write_text(json.dumps({"services": {ONE: {"image": image}}}), encoding="utf-8")
    return Project(project.name, [*project.files, file], project.variables, project.profiles)
