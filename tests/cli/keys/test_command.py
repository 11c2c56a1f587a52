"""``t2 keys`` from the command line: life cycle of a certificate, and errors."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from cli.__main__ import main
from cli.keys.members import read
from common.cli_args import EXIT_CONFIG


class Keys:
    """The command ``t2 keys`` on a folder."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder = folder
        self._capsys = capsys

    def run(self, *words: str, code: int = 0) -> str:
        assert main(["keys", *words, "--folder", str(self.folder)]) == code
        message = self._capsys.readouterr()
        return message.err if code else message.out

    def states(self) -> list[str]:
        """Return the state of each certificate."""
        rows = self.run("list").split("\n\n")[1].splitlines()[1:]
        return [re.split("  +", row)[-1] for row in rows]

    def serials(self) -> list[str]:
        members = read(self.folder / "members.json").members
        return [member.common_name.rpartition(".")[2] for member in members]


@pytest.fixture
def empty(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Keys:
    """Without an authority."""
    return Keys(tmp_path / "keys", capsys)


@pytest.fixture
def keys(empty: Keys) -> Keys:
    empty.run("init", "--site", "berlin")
    return empty


def test_life_cycle_of_a_certificate(keys: Keys) -> None:
    assert "driver.anna." in keys.run("issue", "driver", "anna", "--robot", "001")
    assert keys.states() == ["valid"]
    first = (keys.folder / "driver.anna" / "private.key").read_bytes()
    message = keys.run("renew", "driver", "anna", "--days", "20")
    assert f"t2 keys revoke driver anna --serial {keys.serials()[0]}" in message
    assert (keys.folder / "driver.anna" / "private.key").read_bytes() != first
    assert keys.states() == ["valid", "expires soon"]
    keys.run("issue", "viewer", "anna")
    keys.run("issue", "driver", "ben", "--robot", "001")
    keys.run("revoke", "driver", "anna", "--serial", keys.serials()[0])
    assert keys.states() == ["revoked", "expires soon", "valid", "valid"]
    keys.run("revoke", "driver", "anna")
    assert keys.states() == ["revoked", "revoked", "valid", "valid"]
    assert "no certificate that could be revoked" in keys.run("revoke", "driver", "anna", code=1)
    assert "or a revoked one" in keys.run("renew", "driver", "anna", code=1)
    keys.run("issue", "driver", "anna", "--robot", "002")
    assert keys.states() == ["revoked", "revoked", "valid", "valid", "valid"]


def test_renewal_keeps_rights_and_addresses(keys: Keys) -> None:
    keys.run("issue", "site", "berlin", "--address", "site.example", "--address", "10.0.0.9")
    keys.run("issue", "robot", "001")
    keys.run("issue", "driver", "anna", "--robot", "001", "--robot", "002")
    for who in (("site", "berlin"), ("robot", "001"), ("driver", "anna")):
        keys.run("renew", *who)
    members = read(keys.folder / "members.json")
    assert members.members[2].robots == members.members[5].robots == ("001", "002")
    message = keys.run("renew", "site", "berlin")
    assert "addresses site.example, 10.0.0.9, localhost, 127.0.0.1;" in message
    assert "addresses 10.1.1.1, localhost" in keys.run(
        "renew", "robot", "001", "--address", "10.1.1.1"
    )


def test_routers_are_known_without_their_folders(keys: Keys, tmp_path: Path) -> None:
    keys.run("issue", "robot", "002", "--address", "192.168.1.2")
    target = "192.168.1.2:/etc/t2/keys"
    copied = f"{target}/members.json  # robot 002\n"
    assert copied in keys.run("issue", "driver", "anna", "--robot", "002")
    (keys.folder / "robot.002").rename(tmp_path / "away")
    assert copied in keys.run("revoke", "driver", "anna")
    assert f"/robot.002/. {target}\n" in keys.run("renew", "robot", "002")


def test_what_is_refused_changes_nothing(keys: Keys) -> None:
    who = ("viewer", "hall")
    keys.run("issue", *who)
    before = (keys.folder / "members.json").read_bytes()
    assert "viewer hall has a certificate until" in keys.run("issue", *who, code=1)
    assert "with the serial ''" in keys.run("revoke", *who, "--serial", "", code=1)
    assert (keys.folder / "members.json").read_bytes() == before


def test_the_authoritys_key_may_be_elsewhere(keys: Keys, tmp_path: Path) -> None:
    keys.run("issue", "viewer", "hall")
    key = (keys.folder / "ca.key").rename(tmp_path / "medium")
    assert "ca.key not found: it is needed to sign" in keys.run("renew", "viewer", "hall", code=1)
    keys.run("revoke", "viewer", "hall")
    (keys.folder / "ca.key").symlink_to(key)
    keys.run("issue", "viewer", "hall")


@pytest.mark.parametrize("words", [("issue", "viewer", "v"), ("list",)])
def test_without_an_authority(words: tuple[str, ...], empty: Keys) -> None:
    assert "keys has no CA; `t2 keys init` creates one" in empty.run(*words, code=1)
    assert not empty.folder.exists()


# --- the passphrase -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("typed", "code", "message"),
    [
        (("horse", "horse"), 0, "holds the certificate authority"),
        (("horse", "house"), EXIT_CONFIG, "the two passphrases differ; nothing was created"),
        ((), 1, "the CA's key needs its passphrase: run it in a terminal"),  # without a terminal
    ],
)
def test_a_new_passphrase_is_typed_twice(
    typed: tuple[str, ...],
    code: int,
    message: str,
    empty: Keys,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = iter(typed)
    monkeypatch.setattr("cli.keys.command.getpass", lambda _: next(answers))
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: bool(typed)))
    assert message in empty.run("init", "--passphrase", code=code)
    assert empty.folder.exists() is (code == 0)
    if code == 0:
        assert b"ENCRYPTED" in (empty.folder / "ca.key").read_bytes()
        answers = iter(("house", "horse"))
        assert "wrong passphrase" in empty.run("issue", "viewer", "v", code=1)
        assert "viewer.v." in empty.run("issue", "viewer", "v")
