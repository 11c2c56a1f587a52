"""The texts of the checkout, in both languages."""

import re
from pathlib import Path

import pytest

from cli.commission import steps, texts
from cli.commission.link import judge_link
from cli.commission.manoeuvres import homing, missing_stops, plan
from cli.commission.report import COLUMNS
from cli.commission.texts import TEXTS, Say
from services.safety.config import SafetyConfig
from services.safety.core.causes import LATCHING
from t2.words import PLACEHOLDER
from tests.factories import link

CHINESE = re.compile("[\u4e00-\u9fff]")
NAME = re.compile(r"say\(\s*\"([\w.]+)\"")


def test_every_text_is_complete_in_both_languages() -> None:
    for name, (english, chinese) in TEXTS.items():
        fields = [sorted(set(PLACEHOLDER.findall(text))) for text in (english, chinese)]
        assert fields[0] == fields[1], name
        is_figure = not re.search("[a-z]{2}", PLACEHOLDER.sub("", english))
        assert is_figure or CHINESE.search(chinese), name
    for step in steps.STEPS:
        assert CHINESE.search(step.title[1]), step.name
        assert CHINESE.search(step.what[1]), step.name


def test_every_used_text_is_in_the_table() -> None:
    folder = Path(texts.__file__).parent
    used = {name for file in folder.glob("*.py") for name in NAME.findall(file.read_text("utf-8"))}
    assert {"begin", "link.good", "sonar.now", "drive.warning"} <= used <= TEXTS.keys()
    with pytest.raises(KeyError):
        Say()("of_2030")


def test_a_verdict_in_chinese() -> None:
    links = [link(state="lost"), link(state="lost")]
    verdict = judge_link(links, None, Say("zh"))
    assert verdict.text.startswith("链路未能全程保持在线（当前：lost）")
    assert "。帧数过少，无法判定：0。" in verdict.text


def test_titles_of_manoeuvres_in_chinese() -> None:
    settings, say = SafetyConfig(), Say("zh")
    titles = [each.title for each in plan(settings, say)]
    titles += [back.title for back in [homing(1.0, settings, say)] if back]
    assert len(set(titles)) == len(plan(settings)) + 1
    assert "左转，0.30 rad/s 时 STOP" in "\n".join(titles)
    assert "后退返回 1.00 m" in titles
    assert [title for title in titles if not CHINESE.search(title)] == []
    (missing, *_) = missing_stops([], plan(settings, say), say)
    assert missing == "前进 STOP：6 次中还缺 6 次"


def test_figures_have_names_in_both_languages() -> None:
    verdict = judge_link([link(), link()], None, Say("zh"))
    names = [Say("zh").figure(name) for name, _ in verdict.data]
    assert names[-4:] == ["已确认开启的开关", "接收端口", "中继器", "拒收"]
    assert Say("zh").figure("counted, m/s") == "计数, m/s"
    assert Say().figure("counted, m/s") == "counted, m/s"
    missing = [name for name in COLUMNS if not CHINESE.search(Say("zh").figure(name))]
    assert missing == []


def test_latched_causes_have_names_in_both_languages() -> None:
    assert Say().causes(LATCHING) == tuple(LATCHING)
    assert all(CHINESE.search(name) for name in Say("zh").causes(LATCHING))
    assert (Say().causes(()), Say("zh").causes(["of_2030"])) == ("nothing", ("of_2030",))
