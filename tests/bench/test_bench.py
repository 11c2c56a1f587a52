"""Small runs of two benchmarks, and the document from stored samples."""

import shutil
from collections.abc import Mapping

import pytest

from bench import __main__ as bench
from bench import load, loop, reaction
from bench.figures import HOST, Figures, compared
from bench.fleet import answers_ns
from bench.processes import MissingError
from bench.reaction import BREAK, CLEAR, HIT, JUDGED, LOOP, REFLEX, STANDS, STOP, TIME, ZENOH
from bench.timed import REPEATED, TIMED
from common.freshness import NS_PER_S
from sim.trace import Command
from t2 import messages

CC = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
MS = 1_000_000


def made_up(rows: Mapping[str, int], host_us: int = 20) -> Figures:
    samples = {(row, "quiet", TIME): us for row, us in rows.items()}
    samples |= {(row, "quiet", HOST): host_us for row in rows}
    return {name: [us * 1000] * 10 for name, us in samples.items()}


FIGURES = {
    "reflex": made_up({LOOP: 100, REFLEX: 140}),
    "stop": made_up({JUDGED: 700, ZENOH: 1000}),
}


def test_the_document_has_each_table_and_the_limits() -> None:
    results = {
        name: bench.Result(f"a machine for {name}", FIGURES.get(name, {}))
        for name in bench.BENCHMARKS
    }
    text = bench.page(results)
    assert f"| {REFLEX} | quiet | 140 | 140 | × 1.40 | 20 | 0.0 |" in text
    question = bench.BENCHMARKS["stop"].question
    row = f"| {JUDGED}, quiet, p50: 700 us | {ZENOH}, quiet: 1,000 us | × 0.70 |"
    assert f"| {question} {row} at most × 1 | reached |" in text
    assert (
        f"| {REFLEX}, quiet, p50: 140 us | {LOOP}, quiet: 100 us | × 1.40 | at most × 1.3 | not r"
        in text
    )
    assert all(f"Measured on a machine for {name}." in text for name in bench.BENCHMARKS)


def test_what_a_host_lacks_is_on_the_page(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def lacking() -> Figures:
        raise MissingError("no C compiler")

    it = bench.BENCHMARKS["link"]
    made = bench.Benchmark(it.question, lacking, it.heads, it.columns, it.limits)
    monkeypatch.setitem(bench.BENCHMARKS, "link", made)
    assert bench.main(["--only", "link"]) == 0
    assert "; not measured: no C compiler." in capsys.readouterr().out


def test_a_limit_of_a_row_that_was_not_measured_is_left_out() -> None:
    rows = compared("How soon?", reaction.LIMITS, FIGURES["reflex"])
    assert [row[0] for row in rows] == ["How soon?", ""]
    assert [row[-1] for row in rows] == ["not reached", "reached"]


def test_a_host_that_stalls_longer_than_a_figure_leaves_no_verdict() -> None:
    rows = compared("How soon?", reaction.LIMITS, made_up({LOOP: 100, REFLEX: 140}, host_us=101))
    assert [row[-1] for row in rows] == ["not comparable: host 101 us"] * 2
    late_ns = [0] * 9 + [MS]
    busy_host = {**made_up({LOOP: 100, REFLEX: 140}), (LOOP, "quiet", HOST): late_ns}
    rows = compared("How soon?", reaction.LIMITS, busy_host)
    assert [row[-1] for row in rows] == [
        "not comparable: the host had changed", "not comparable: host 1,000 us"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("late_us", "is_alike"), [((50, 400), True), ((50, 401), False), ((200, 800), True),
                              ((200, 801), False)],
)  # fmt: skip
def test_rows_of_a_host_that_has_changed_have_no_verdict(
    late_us: tuple[int, int], is_alike: bool
) -> None:
    figures: Figures = dict(made_up({LOOP: 1000, REFLEX: 1200}))
    for row, each_us in zip((LOOP, REFLEX), late_us, strict=True):
        figures = {**figures, (row, "quiet", HOST): [each_us * 1000]}
    rows = compared("How soon?", reaction.LIMITS, figures)
    changed = "not comparable: the host had changed"
    assert [row[-1] for row in rows] == ["reached" if is_alike else changed] * 2


def test_of_cpu_the_share_of_time_that_the_host_took_is_compared() -> None:
    ours, theirs = (load.T2, load.TOGETHER), (load.PAIR, load.TOGETHER)
    figures: Figures = {
        (*ours, "cpu"): [160 * MS], (*theirs, "cpu"): [80 * MS],
        (*ours, HOST): [MS // 5], (*theirs, HOST): [MS // 5],
    }  # fmt: skip
    rows = compared("What?", load.CPU_LIMITS, figures)
    assert [row[-1] for row in rows] == ["not comparable: host 9.1 CPU %"]
    rows = compared("What?", load.CPU_LIMITS, {**figures, (*theirs, HOST): [0], (*ours, HOST): [0]})
    assert [row[-1] for row in rows] == ["reached"]


def test_the_one_process_has_the_frames_of_the_bridge() -> None:
    assert (loop.command(loop.BREAK).hex(), loop.command(loop.STOP).hex()) == (BREAK, STOP)
    received = [bytes.fromhex(each) for each in (HIT, CLEAR, STANDS, HIT[:-2] + "00", HIT[:6])]
    assert [loop.is_hit(each) for each in received] == [True, False, False, False, False]


def test_a_request_is_answered_by_the_next_frame_with_its_speed() -> None:
    def frame(at_ns: int, linear: float) -> Command:
        return Command(mono_ns=at_ns, kind=messages.Command.RUN, linear=linear, angular=0.0)

    requests = [(10 * MS, 0.301), (60 * MS, 0.302), (110 * MS, 0.303)]
    late = 110 * MS + NS_PER_S
    commands = [frame(5 * MS, 0.301), frame(12 * MS, 0.301), frame(65 * MS, 0.302)]
    commands += [frame(late, 0.303)]
    assert answers_ns(requests, commands) == [2 * MS, 5 * MS, None]


@CC
@pytest.mark.campaign
@pytest.mark.timed
@pytest.mark.parametrize("rows", [reaction.REFLEX_ROWS, reaction.STOP_ROWS], ids=["reflex", "stop"])
def test_each_row_answers_every_hit(
    rows: Mapping[str, reaction.Start], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reaction, "LOADS", ("quiet",))
    figures = reaction.measured(rows, blocks=1, hits=3)
    for name in rows:
        samples = figures[name, "quiet", TIME]
        assert len(samples) == 3, name
        assert all(0 < ns < NS_PER_S for ns in samples), name
        assert figures[name, "quiet", HOST], name


@pytest.mark.campaign
@pytest.mark.timed
def test_consumers_receive_everything() -> None:
    figures = load.consumers((1, 2), seconds=1.0)
    for count in ("1", "2"):
        assert figures[count, "delay"]
        assert figures[count, "lost"] == [0.0]


@pytest.mark.campaign
@pytest.mark.timed
def test_each_function_of_the_chain_is_timed() -> None:
    figures = load.functions(1.0)
    for service, functions in TIMED.items():
        for owner, name in functions:
            assert figures[service, f"{owner.__name__}.{name}", "time"], name
    assert figures["safety", f"{REPEATED}, once more", "time"]
