"""What the screen shows, and that it fits the terminal."""

from functools import partial

import pytest
from textual.pilot import Pilot

from common import keys
from common.freshness import NS_PER_S
from common.messages import Ultrasonic
from services.teleop.app import Panel
from tests.factories import link, safety_state
from tests.teleop.screen_fixture import Screen, fits, play, tell_contact, until


def test_refused_keys_are_shown(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        screen.now_ns += 10 * NS_PER_S
        screen.controller.tick(screen.now_ns)
        await until(lambda: "KEYS OFF" in screen.text_of("hints"), "the refusal")

    play(screen, act)


def test_help_opens_and_any_other_key_closes_it(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("question_mark")
        await until(lambda: screen.app.query_one("#help", Panel).display, "the help")
        assert not screen.app.query_one("#events", Panel).display
        assert fits(screen, "help")
        await pilot.press("w")
        await until(lambda: not screen.app.query_one("#help", Panel).display, "its end")
        assert screen.speeds(5)  # the key counts

    play(screen, act)


def test_an_unconfirmed_emergency_stop_is_shown_until_it_is_latched(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("e")
        for _ in range(70):
            screen.controller.tick(screen.now_ns)
        await until(lambda: "EMERGENCY STOP NOT CONFIRMED" in screen.text_of("safety"), "it")
        safety = screen.app.query_one("#safety", Panel)
        await until(lambda: safety.content_size.height == 3, "the new layout")
        for name in ("safety", "motion", "around", "hints"):
            await until(partial(fits, screen, name), f"{name} to fit")
        state = safety_state(verdict="brake", latched=("estop",))
        screen.node.fake.deliver(keys.SAFETY, state, received_ns=screen.now_ns)
        screen.controller.tick(screen.now_ns)
        await until(lambda: "NOT CONFIRMED" not in screen.text_of("safety"), "its end")

    play(screen, act)


@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
def test_a_contact_shows_its_release_without_clipping(
    screen: Screen, size: tuple[int, int]
) -> None:
    async def act(pilot: Pilot[None]) -> None:
        tell_contact(screen)
        await until(lambda: "LATCHED" in screen.text_of("safety"), "the cause")
        for name in ("safety", "motion", "around"):
            await until(partial(fits, screen, name), f"{name} to fit")
        assert "0.12 m left" in screen.text_of("safety")
        refusal = "release refused: " + "the vehicle needs two rows to say why it may not. " * 2
        screen.node.event_log.add("safety", "warning", refusal.strip())
        screen.controller.tick(screen.now_ns)
        await until(
            lambda: " ".join(screen.text_of("events").split())[16:] == refusal.strip(), "all of it"
        )

    play(screen, act, *size)


def test_received_values_are_shown(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        fake = screen.node.fake
        fake.deliver(keys.SAFETY, safety_state(text="Driving, slowly."))
        fake.deliver(keys.LINK, link())
        fake.deliver(
            keys.ULTRASONIC, Ultrasonic(ranges=(1.5, *(None,) * 7), status=("ok", *("fault",) * 7))
        )
        screen.controller.tick(0)
        await until(lambda: "Driving, slowly." in screen.text_of("safety"), "safety's words")
        assert "10.7.5.224:4002" in screen.text_of("motion")
        assert "1.50 m" in screen.text_of("around")
        assert screen.text_of("around").count("fault") == 7
        assert "no router yet" in screen.text_of("header")
        screen.node.event_log.add("safety", "error", "contact")
        screen.controller.tick(0)
        await until(lambda: "contact" in screen.text_of("events"), "the event")

    play(screen, act)


@pytest.mark.parametrize(("size", "rows"), [((80, 24), 11), ((120, 40), 13)])
def test_the_screen_fits_and_grows(screen: Screen, size: tuple[int, int], rows: int) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await until(
            lambda: len(screen.text_of("around").split("\n")) == rows, f"a drawing of {rows} rows"
        )
        for panel in screen.app.query(Panel):
            assert screen.app.screen.region.contains_region(panel.region), panel.id
        assert (
            screen.text_of("motion").count("\n")
            < screen.app.query_one("#motion").content_size.height
        )

    play(screen, act, *size)
