"""The search's stack, with the real shells of localization and patrol."""

from pathlib import Path
from typing import Any

import msgspec

from services.localization.config import FixSource, Localization, LocalizationConfig
from services.localization.localization import LocalizationService
from services.patrol.config import Patrol, PatrolConfig
from services.patrol.patrol import PatrolService
from services.safety.config import Safety, Source
from t2 import keys
from t2 import messages as m
from t2.keys import Call
from verification.localization.source import SOURCE
from verification.patrol.draw import NAME, Scene
from verification.search.bus import MS, Caller, Process
from verification.search.draw import TURN_BRAKING, Draw
from verification.search.stack import Stack

STEP_NS = 10 * MS
SOURCES = {**Safety().sources, "patrol": Source(priority=5, lease=0.3)}  # as config/patrol.toml
SONAR_MAX = "sim.sonar.saturation"  # the settings name it, otherwise safety creeps
ANNOUNCE_S, PATIENCE_S = 1.0, 20.0


class Robot(Stack):
    """A vehicle that drives rounds; its folder of patrol has the route."""

    def __init__(self, draw: Draw, scene: Scene, folder: Path) -> None:
        routes = folder / "routes"
        routes.mkdir()
        (routes / f"{NAME}.json").write_bytes(msgspec.json.encode(scene.route))
        settings = Localization(sources={SOURCE: FixSource(sigma=0.01, heading_sigma=0.01)})
        self._configs = {
            "localization": LocalizationConfig(localization=settings),
            "patrol": PatrolConfig(
                patrol=Patrol(folder=str(folder), announce=ANNOUNCE_S, patience=PATIENCE_S)
            ),
        }
        super().__init__(
            draw.model(),
            scene.plan,
            seed=draw.seed,
            step_ns=STEP_NS,
            turn_braking=float(draw.get(TURN_BRAKING, 1.0)),
            settings={"safety.sources": SOURCES, "vehicle.sonar_max": draw.get(SONAR_MAX, 5.0)},
        )
        self.processes |= {name: self._start(name) for name in self._configs}

    def _start(self, name: str) -> Process:
        if name not in self._configs:
            return super()._start(name)
        process: Any = self.process(name)
        process.config = self._configs[name]
        with self.time():
            if name == "patrol":
                PatrolService(process)
            else:
                LocalizationService(process)
        return process  # type: ignore[no-any-return]

    def ask(self, service: str, call: Call[Any, Any], request: Any) -> Caller:
        """Call a service."""
        with self.time():
            return self.processes[service].call(call, request)

    def act(self, action: m.RoundAction, route: str | None = None) -> Caller:
        """Ask for an action of the round, as an operator."""
        echo = self.seen.heartbeat if self.seen else None
        request = m.RoundRequest(action=action, route=route, echo=echo)
        return self.ask("patrol", keys.ROUND, request)
