"""Calls that a router drops: the client library names the reason."""

from pathlib import Path

import pytest
import zenoh

import t2
from common.bus.session import client_config
from verification.harness.bus import at
from verification.harness.certificates import ADDRESS, Site

LED = "t2/v1/001/srv/bridge/led"


def test_an_unanswered_call_names_a_missing_right_or_service(tmp_path: Path) -> None:
    def led(member: str) -> None:
        with t2.connect(
            "001", endpoint=secured, config=tmp_path / "keys" / member / "bus.toml"
        ) as robot:
            robot.led(channel=1, mode=1)

    site = Site(tmp_path / "keys")
    site.member("robot", "001", "--address", ADDRESS)
    site.member("driver", "anna", "--robot", "001")
    site.member("viewer", "hall")
    with site.router(site.settings("robot", "001")) as (secured, onboard):
        with pytest.raises(t2.NoData, match="is bridge running"):
            led("viewer.hall")
        with (
            zenoh.open(client_config(at(onboard))) as bridge,
            bridge.declare_queryable(LED, lambda _: None),  # hangs
            bridge.liveliness().declare_token("t2/v1/001/live/bridge/1"),
        ):
            with pytest.raises(t2.NotAllowed, match="this certificate may not call it"):
                led("viewer.hall")
            with pytest.raises(t2.NoData, match="is bridge running"):
                led("driver.anna")
