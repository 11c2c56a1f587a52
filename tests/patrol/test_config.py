"""Settings of patrol: what is refused, and with which text."""

from datetime import datetime

import pytest

from services.patrol.config import Patrol, ScheduledRound
from services.patrol.patrol import zone

NOON = datetime(2026, 6, 1, 12)


@pytest.mark.parametrize("cron", ["0 22 * * *", "*/15 8-18 * * 1-5", "30 2 1 * *"])
def test_cron_expressions(cron: str) -> None:
    assert ScheduledRound(route="yard", cron=cron).cron == cron


@pytest.mark.parametrize("cron", ["", "22:00", "0 25 * * *", "* * * * * *", "0 0 31 2 *"])
def test_another_text_is_refused(cron: str) -> None:
    with pytest.raises(ValueError, match="allowed is a cron expression"):
        ScheduledRound(route="yard", cron=cron)


@pytest.mark.parametrize("name", ["Mars/Base", "../../etc/passwd", "Europe"])
def test_an_unknown_time_zone_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="timedatectl"):
        Patrol(timezone=name)


def test_the_time_zone_is_that_of_the_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    assert str(zone("Asia/Shanghai")) == "Asia/Shanghai"
    monkeypatch.setenv("TZ", ":Europe/Berlin")
    assert str(zone("")) == "Europe/Berlin"
    monkeypatch.delenv("TZ")
    computer = zone("").utcoffset(NOON)
    assert computer is not None
    for other in (":/etc/localtime", "CET-1CEST", "../x"):
        monkeypatch.setenv("TZ", other)
        assert zone("").utcoffset(NOON) == computer
