"""Sources of settings, their precedence, and the error texts."""

import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from cli.settings import Everything
from common.config import DEFAULT, DEFAULT_FILE, Loaded, Sources, flatten, load
from common.errors import ConfigError
from common.settings import Shared


class SettingsFixture:
    """A directory to write settings in, which is the working directory too."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def file(self, text: str, name: str = "over.toml") -> Path:
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return path

    def load(
        self, *texts: str, environ: dict[str, str] | None = None, sets: Sequence[str] = ()
    ) -> Loaded[Everything]:
        files = [self.file(text, f"over{number}.toml") for number, text in enumerate(texts)]
        return load(Everything, Sources((DEFAULT_FILE, *files), environ or {}, sets))

    def refused(
        self, *texts: str, environ: dict[str, str] | None = None, sets: Sequence[str] = ()
    ) -> str:
        with pytest.raises(ConfigError) as caught:
            self.load(*texts, environ=environ, sets=sets)
        return str(caught.value)


@pytest.fixture
def settings_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SettingsFixture:
    monkeypatch.chdir(tmp_path)
    return SettingsFixture(tmp_path)


# --- the file that we ship ----------------------------------------------------------------------


def test_the_shipped_file_sets_nothing() -> None:
    settings = load(Everything, Sources(environ={})).settings
    assert {setting.origin for setting in settings.values()} == {DEFAULT}


def test_the_lines_of_the_shipped_file_are_the_defaults(tmp_path: Path) -> None:
    text = DEFAULT_FILE.read_text(encoding="utf-8")
    file = tmp_path / "t2.toml"
    file.write_text(re.sub(r"(?m)^# (?=\[|\w+ = )", "", text), encoding="utf-8")
    loaded = load(Everything, Sources((file,), environ={}))
    assert loaded.config == Everything()
    assert all(one.origin != DEFAULT for one in loaded.settings.values() if one.value != {})


# --- what wins ----------------------------------------------------------------------------------


def test_the_later_source_wins_and_every_setting_knows_its_own(
    settings_dir: SettingsFixture,
) -> None:
    loaded = settings_dir.load(
        "[board]\nport = 1\n[vehicle]\nmax_linear = 0.1\n[odom]\nturn_noise = 0.2",
        environ={"T2__BOARD__PORT": "2", "T2__Vehicle__max_linear": "0.15", "PATH": "/bin"},
        sets=["board.port=3"],
    )
    given = ("board.port", "vehicle.max_linear", "odom.turn_noise", "robot.id")
    assert [(loaded.settings[path].value, loaded.settings[path].origin) for path in given] == [
        (3, "--set board.port=3"),
        (0.15, "environment T2__Vehicle__max_linear"),
        (0.2, "over0.toml"),
        ("001", DEFAULT),
    ]
    assert loaded.config.board.port == 3
    assert set(loaded.settings) == {path for path, _ in flatten(Everything())}


def test_the_files_of_a_certificate_lie_beside_the_file_that_names_them(
    settings_dir: SettingsFixture,
) -> None:
    (settings_dir.folder / "keys").mkdir()
    settings_dir.file("[bus]\nca = 'ca.pem'\nmembers = '/etc/t2/members.json'", "keys/bus.toml")
    file = Path("keys/bus.toml")
    loaded = load(Everything, Sources((file,), {}, ["bus.private_key=private.key"]))
    assert loaded.config.bus.ca == str(settings_dir.folder / "keys" / "ca.pem")
    assert loaded.config.bus.members == "/etc/t2/members.json"
    assert loaded.config.bus.private_key == "private.key"  # nobody put that beside anything
    assert loaded.config.bus.certificate == ""
    assert loaded.settings["bus.ca"].origin == "keys/bus.toml"


def test_a_service_leaves_the_sections_of_others_alone(settings_dir: SettingsFixture) -> None:
    file = settings_dir.file(
        "unsafe_overrides = ['safety.x']\n[safety]\nnonsense = 1\n[robot]\nid = 'x'"
    )
    loaded = load(Shared, Sources((file,), {"T2__ODOM__NONSENSE": "1"}))
    assert loaded.config.robot.id == "x"
    assert not any(path.startswith(("safety", "odom")) for path in loaded.settings)


# --- how values are read ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("robot.id=007", "robot.id", "007"),  # text stays text
        ("board.listen_ports=4002, 4001", "board.listen_ports", (4002, 4001)),
        ("board.listen_ports=[4002]", "board.listen_ports", (4002,)),
        ("bus.listen=tcp/[::1]:1,ws/[::1]:2", "bus.listen", ("tcp/[::1]:1", "ws/[::1]:2")),
        ("bus.connect=", "bus.connect", ()),
        ("teleop.gamepad=false", "teleop.gamepad", False),
        ("odom.turn_noise=5e-2", "odom.turn_noise", 0.05),
        ("log.format=json", "log.format", "json"),
        ("safety.sources.web.priority=3", "safety.sources.web.priority", 3),
    ],
)  # fmt: skip
def test_a_set_is_read_as_its_field_wants_it(
    settings_dir: SettingsFixture, text: str, path: str, value: object
) -> None:
    found, _, given = text.partition("=")
    name = "T2__" + found.strip().upper().replace(".", "__")
    for loaded in (
        settings_dir.load(sets=[text]),
        settings_dir.load(environ={name: given.strip()}),
    ):
        assert dict(flatten(loaded.config))[path] == value


def test_a_table_adds_to_what_was_given_before(settings_dir: SettingsFixture) -> None:
    file = "[safety.sources.nav]\npriority = 40\nlease = 0.1"
    loaded = settings_dir.load(file, sets=["safety.sources={new={priority=5,lease=0.2}}"])
    sources = loaded.config.safety.sources
    assert sources["nav"].priority == 40
    assert sources["new"].priority == 5
    assert sources["teleop"].priority == 30
    assert loaded.settings["safety.sources.new.lease"].origin.startswith("--set safety.sources=")


@pytest.mark.parametrize("empty", ["[board]", "board = {}", "[safety.sources]", ""])
def test_an_empty_table_takes_nothing_away(settings_dir: SettingsFixture, empty: str) -> None:
    loaded = settings_dir.load("[board]\nport = 5000", empty)
    assert loaded.config.board.port == 5000
    assert "web" in loaded.config.safety.sources


# --- what is refused, and in which words --------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[bord]\nport = 1", "over0.toml: bord.port: no section 'bord'; did you mean 'board'?"),
        ("[bridge]\nbumper_rate = 40.0", "over0.toml: bridge.bumper_rate: no section 'bridge'"),
        ("[safety]\nstall = 1", "over0.toml: safety.stall: unknown; did you mean 'host.stall'?"),
        ("[board]\nprot = 1", "over0.toml: board.prot: unknown; did you mean 'port'?"),
        ("[sim.drive]\ncoast = 1", "over0.toml: sim.drive: unknown"),
        ("[safety]\nprotections = 1", "over0.toml: safety.protections: unknown"),
        ("[sim]\nzzz = 1", "over0.toml: sim.zzz: unknown; there are camera_port, control_port,"),
        ("[board.port]\nx = 1", "over0.toml: board.port.x: port is a value, not a table"),
        ("[board]\nport = 70000", "port = 70000: Expected `int` <= 65535; allowed is 1..65535"),
        ("safety.sources = 3", "over0.toml: safety.sources = 3: Expected `object`, got `int`"),
        ("[vehicle]\nwidth = nan", "vehicle.width = nan: Expected `float` >= 0.2; allowed is 0.2"),
        ("[odom]\nturn_noise = 0", "allowed is over 0.0..10.0 rad per sqrt(rad) turned"),
        ("[safety]\nmargin = 5", "Expected `float` <= 2.0; allowed is 0.0..2.0 m"),
        ("[safety.sources.web]\nlease = 99", "allowed is over 0.0..10.0 s"),
        ("[vehicle]\ngears_linear = [9, 9, 9, 9, 9]", "<= 3.0; allowed is over 0.0..3.0 m/s"),
        ("[vehicle.sonars.front]\nx = ''", "Expected `float`, got `str`; the unit is m"),
        ("[bus]\nca = 1", "bus.ca = 1: Expected `str`, got `int`"),
        ("[sim]\nseed = -1", "over0.toml: sim.seed = -1: Expected `int` >= 0"),
        ("[log]\nlevel = 'loud'", "allowed is 'debug', 'error', 'info', 'warning'"),
        ("[board]\nlisten_ports = [1, 70000]", "board.listen_ports = [1, 70000]: Expected `int`"),
        ("[safety.sources.web]\nprio = 1", "over0.toml: safety.sources.web.prio: unknown; did you"),
        ("[safety.sources.new]\nlease = 0.1", "over0.toml: safety.sources.new: needs 'priority'"),
        (
            "[safety]\nmargin = 0",
            "over0.toml: safety.margin = 0.0 takes a protection away; allowed is 0.05..2.0 m, or "
            "name 'safety.margin' in unsafe_overrides",
        ),
        (
            "unsafe_overrides = ['safety.react']\n[safety]\nmargin = 0",
            "over0.toml: safety.margin = 0.0 takes a protection away",
        ),
        (
            "unsafe_overrides = ['safety.margin']",
            "over0.toml: unsafe_overrides names 'safety.margin', but 0.2 is safe (0.05..2.0 m): "
            "remove it there",
        ),
        ("[safety]\nunsafe_overrides = ['margin']", "over0.toml: safety.unsafe_overrides: unknown"),
        ("unsafe_overrides = ['log.level']", "'log.level', which takes no protection away"),
        ("unsafe_overrides = ['safty.margin']", "away; did you mean 'safety.margin'?"),
        ("unsafe_overrides = [1]", "unsafe_overrides = [1]: Expected `str`, got `int`"),
        ("[board]\nport = 4001", "over0.toml: board: port 4001 of 127.0.0.1 is both the board's"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_refused_by_name_value_and_range(
    settings_dir: SettingsFixture, text: str, sentence: str
) -> None:
    said = settings_dir.refused(text)
    assert sentence in said
    assert "over0.toml" in said


DEEP = ".".join("a" * 3000)
MANY_DIGITS = "1" * 5000  # more than Python reads


@pytest.mark.parametrize(
    ("sets", "environ", "sentence"),
    [
        ("board.port", "", "--set board.port: should look like board.port=4002"),
        ("=4002", "", "--set =4002: should look like board.port=4002"),
        ("board.port=", "", "--set board.port=: board.port = '': Expected `int`, got `str`"),
        ("board..port=3", "", "--set board..port=3: board.: unknown"),
        ("safety.sources.web.lease=99", "", "sources.web.lease = 99: Expected `float` <= 10.0"),
        (f"board.port={MANY_DIGITS}", "", f"port = '{MANY_DIGITS}': Expected `int`, got `str`"),
        ("robot.id=\udcff", "", r"\udcff: is no UTF-8"),
        (f"board={{{DEEP} = 1}}", "", ": tables are nested too deep"),
        ("", "BOARD__PORT=x", "environment T2__BOARD__PORT: board.port = 'x': Expected `int`"),
        ("", "BOARD=1", "environment T2__BOARD: board = 1: Expected `object`, got `int`"),
        ("", "=1", "environment T2__: : no section ''"),
    ],
    ids=range(11),
)
def test_a_wrong_set_or_environment_is_refused(
    settings_dir: SettingsFixture, sets: str, environ: str, sentence: str
) -> None:
    name, _, value = environ.partition("=")
    given = {f"T2__{name}": value} if environ else {}
    said = settings_dir.refused(environ=given, sets=[sets] if sets else ())
    assert sentence in said


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (b"a = ", "over.toml: is no TOML: "),
        (b"a = '\xff'", "over.toml: line 1 is no UTF-8: save the file as UTF-8"),
        (f"[board]\nport = {MANY_DIGITS}".encode(), "over.toml: is no TOML: "),
        (f"[board]\n{DEEP} = 1".encode(), "over.toml: tables are nested too deep"),
        (None, "over.toml: cannot be read: No such file"),
    ],
    ids=["no TOML", "no UTF-8", "digits", "deep", "missing"],
)
def test_an_unreadable_file_is_refused(
    settings_dir: SettingsFixture, text: bytes | None, sentence: str
) -> None:
    if text is not None:
        (settings_dir.folder / "over.toml").write_bytes(text)
    with pytest.raises(ConfigError, match=f"^{re.escape(sentence)}"):
        load(Shared, Sources((Path("over.toml"),), {}))


# --- files and values of other people's editors and shells ---------------------------------------


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_file_with_a_byte_order_mark_and_crlf(
    settings_dir: SettingsFixture, encoding: str
) -> None:
    file = settings_dir.folder / "windows.toml"
    file.write_bytes('[log]\r\nlevel = "debug"\r\n'.encode(encoding))
    assert load(Everything, Sources((file,), {})).config.log.level == "debug"


def test_a_typographic_quote_is_named(settings_dir: SettingsFixture) -> None:
    said = settings_dir.refused("[log]\nlevel = \u201cdebug\u201d\n")
    assert "line 2 has LEFT DOUBLE QUOTATION MARK" in said


def test_the_home_folder_in_each_source(
    settings_dir: SettingsFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", "/home/ada")
    config = settings_dir.load(
        '[bus]\nca = "~/ca.pem"\nlisten = ["unixsock-stream/~/bus.sock"]\n',
        environ={"T2__DASHBOARD__TOKEN_FILE": "~/token"},
        sets=["recorder.folder=~/recordings", "sim.world='~/world.toml'"],
    ).config
    assert config.bus.ca == "/home/ada/ca.pem"
    assert config.bus.listen == ("unixsock-stream//home/ada/bus.sock",)
    assert config.dashboard.token_file == "/home/ada/token"
    assert config.recorder.folder == "/home/ada/recordings"
    assert config.sim.world == "/home/ada/world.toml"
    said = settings_dir.refused(sets=["recorder.folder=~nobody-here/x"])
    assert "recorder.folder: ~nobody-here/x: no home folder is known" in said


@pytest.mark.parametrize("value", ['"/my disk"', "'/my disk'", "/my disk", "\u00a0/my disk "])
def test_quotes_around_a_path(settings_dir: SettingsFixture, value: str) -> None:
    assert settings_dir.load(sets=[f"recorder.folder={value}"]).config.recorder.folder == "/my disk"
    environ = {"T2__RECORDER__FOLDER": value.strip()}
    assert settings_dir.load(environ=environ).config.recorder.folder == "/my disk"


@pytest.mark.parametrize("value", ['"', '"/my disk', "'/a'b", "\u201c/my disk\u201d", '"""'])
def test_quotes_that_do_not_enclose_a_path(settings_dir: SettingsFixture, value: str) -> None:
    said = settings_dir.refused(sets=[f"recorder.folder={value}"])
    assert "the quotes do not enclose the value" in said
