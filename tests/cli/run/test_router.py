"""``t2 router``: start, errors, printed configuration and exit."""

import json
import signal
from pathlib import Path

import pytest
import zenoh

from cli.__main__ import main
from common.bus.session import client_config
from common.cli_args import EXIT_CONFIG, EXIT_LINK
from tests.cli.processes import PATIENCE_S, ran, sets
from verification.harness.bus import at, router_process
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


def test_a_taken_port_is_an_error_and_ctrl_c_exits_cleanly() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with router_process(endpoint) as first:
        second = ran("router", *sets(f"bus.listen={endpoint}"))
        assert second.returncode == EXIT_LINK
        assert f"t2 router: the router cannot listen on {endpoint}: " in second.stderr
        assert "in use" in second.stderr
        assert "Traceback" not in second.stderr
        first.send_signal(signal.SIGINT)
        assert first.wait(PATIENCE_S) == 0


def test_the_router_has_threads_for_dead_links() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with router_process(endpoint) as router, zenoh.open(client_config(at(endpoint))):
        tasks = Path(f"/proc/{router.pid}/task")

        def readers() -> int:
            names = [comm.read_text(encoding="ascii") for comm in tasks.glob("*/comm")]
            return sum(name.startswith("rx-") for name in names)

        wait_until(lambda: readers() >= 32, "threads that read")


def test_print_the_configuration_for_zenohd(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["router", "--print", str(tmp_path / "router.json5")]) == 0
    printed = (tmp_path / "router.json5").read_text()
    zenoh.Config.from_json5(printed)  # rejects unknown settings
    assert json.loads(printed)["mode"] == "router"
    assert main(["router", "--print", str(tmp_path / "none" / "x")]) == EXIT_CONFIG
    assert "/none/x: cannot be written: No such file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "words"),
    [(None, "cannot be read: No such file or directory; `t2 keys` makes it"),
     ("[", "is no list of members: ")],
)  # fmt: skip
def test_an_invalid_member_list(
    text: str | None, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    listed = tmp_path / "members.json"
    if text is not None:
        listed.write_text(text)
    assert main(["router", *sets(f"bus.members={listed}")]) == EXIT_CONFIG
    assert f"t2 router: {listed}: {words}" in capsys.readouterr().err
