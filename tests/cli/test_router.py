"""``t2 router``: it listens or says why not, and leaves when told."""

import signal

import pytest

from cli.__main__ import main
from common.options import EXIT_CONFIG, EXIT_LINK
from tests.cli.processes import PATIENCE_S, ran, sets
from tests.support import free_port, router_process


def test_a_taken_port_is_a_sentence_and_ctrl_c_a_clean_end() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with router_process(endpoint) as first:
        second = ran("router", *sets(f"bus.listen={endpoint}"))
        assert second.returncode == EXIT_LINK
        assert f"t2 router: the router cannot listen on {endpoint}: " in second.stderr
        assert "in use" in second.stderr
        assert "Traceback" not in second.stderr
        first.send_signal(signal.SIGINT)
        assert first.wait(PATIENCE_S) == 0


def test_an_address_of_another_host_is_a_sentence() -> None:
    result = ran("router", *sets("bus.listen=tcp/192.0.2.1:7447"))
    assert result.returncode == EXIT_LINK
    assert result.stderr.startswith("t2 router: the router cannot listen on tcp/192.0.2.1:7447: ")
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize("endpoint", ["router", "tcp/", "/127.0.0.1:7447"])
def test_what_is_no_endpoint_is_refused_before_anything_opens(
    endpoint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["router", *sets(f"bus.listen={endpoint}")]) == EXIT_CONFIG
    assert "should look like tcp/127.0.0.1:7447" in capsys.readouterr().err
