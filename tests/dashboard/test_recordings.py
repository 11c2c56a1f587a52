"""Recordings and their reports, served by the dashboard."""

import json
import os
import socket
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.dashboard import recordings
from services.dashboard.auth import content_policy
from verification.harness.dashboard import Server, dashboard

OLD, NEW = "001-20260315-081530.mcap", "001-20260316-081530-latch-contact.mcap"
BIG, BIG_SIZE = "001-20250101-000000.mcap", 4_000_000
REPORT = NEW.replace(".mcap", ".html")


@pytest.fixture(scope="module")
def server(endpoint: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("server")
    kept = folder / "recordings"
    kept.mkdir()
    (folder / "secret.html").write_text("secret")
    for number, name in enumerate((OLD, NEW)):
        (kept / name).write_bytes(bytes(100_000 * (number + 1)))
        os.utime(kept / name, (number, number))
    (kept / BIG).write_bytes(bytes(BIG_SIZE))
    os.utime(kept / BIG, (-1, -1))
    (kept / REPORT).write_text("<style>b{}</style>a report")
    (kept / "notes.txt").write_text("not a recording")
    (kept / ".hidden.mcap").write_text("not a recording")
    (kept / "link.html").symlink_to(folder / "secret.html")
    with dashboard(endpoint, folder, f"dashboard.recordings={kept}") as it:
        yield it


def test_downloads_share_a_rate_and_one_that_takes_nothing_holds_up_no_other(
    server: Server,
) -> None:
    with socket.create_connection(("127.0.0.1", server.port)) as stalled:
        stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        request = f"GET /recordings/{BIG} HTTP/1.1\r\nHost: localhost:{server.port}\r\n\r\n"
        stalled.sendall(request.encode())
        began_s = time.monotonic()
        with (
            urllib.request.urlopen(f"{server.url}recordings/{BIG}") as one,
            urllib.request.urlopen(f"{server.url}recordings/{OLD}") as other,
        ):
            sizes = len(other.read()), len(one.read())
        assert sizes == (100_000, BIG_SIZE)
        assert time.monotonic() - began_s > (100_000 + BIG_SIZE) / recordings.RATE * 0.8


def test_the_newest_is_listed_first_with_its_report(server: Server) -> None:
    with urllib.request.urlopen(f"{server.url}recordings/") as answer:
        listed = json.load(answer)
    assert [(each["name"], each["size"], each["report"]) for each in listed] == [
        (NEW, 200_000, REPORT),
        (OLD, 100_000, ""),
        (BIG, BIG_SIZE, ""),
    ]


def test_a_recording_is_downloaded_and_a_report_is_shown_without_scripts(server: Server) -> None:
    with urllib.request.urlopen(f"{server.url}recordings/{NEW}") as answer:
        assert answer.headers["content-disposition"] == f'attachment; filename="{NEW}"'
        assert answer.read() == bytes(200_000)
    with urllib.request.urlopen(f"{server.url}recordings/{REPORT}") as answer:
        policy = answer.headers["content-security-policy"]
        assert policy == recordings.REPORT_POLICY
        assert "sandbox" in policy
        assert "script" not in policy
        assert answer.headers["content-type"].startswith("text/html")
        assert answer.read() == b"<style>b{}</style>a report"


@pytest.mark.parametrize(
    "name",
    ["notes.txt", "link.html", "none.mcap", "..%2Fsecret.html", ".hidden.mcap"],
)
def test_nothing_else_is_served(server: Server, name: str) -> None:
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(f"{server.url}recordings/{name}")


def test_a_folder_that_does_not_exist_has_no_recordings(tmp_path: Path) -> None:
    assert list(recordings.listed(tmp_path / "none")) == []


def test_an_empty_setting_serves_nothing(endpoint: str, tmp_path: Path) -> None:
    with (
        dashboard(endpoint, tmp_path, "dashboard.recordings=") as server,
        pytest.raises(urllib.error.HTTPError, match="404"),
    ):
        urllib.request.urlopen(f"{server.url}recordings/")


def test_only_the_origin_of_the_camera_may_be_shown() -> None:
    policy = content_policy("http://10.0.0.5:8081/{robot}/stream")
    assert "img-src 'self' http://10.0.0.5:8081; " in policy
    assert "img-src 'self' ; " in content_policy("")
