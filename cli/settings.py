"""The configuration of the whole stack: the sections of all services."""

from common import settings
from services.bridge.config import Bridge
from services.dashboard.config import Dashboard
from services.metrics.config import Metrics
from services.odom.config import Odom
from services.recorder.config import Recorder
from services.safety.config import Safety
from services.teleop.config import Teleop
from sim.config import Sim


class Everything(settings.Shared, frozen=True, kw_only=True):
    """All sections that a file in ``config/`` may have."""

    board: settings.Board = settings.Board()
    wire: settings.Wire = settings.Wire()
    vehicle: settings.Vehicle = settings.Vehicle()
    bridge: Bridge = Bridge()
    safety: Safety = Safety()
    odom: Odom = Odom()
    teleop: Teleop = Teleop()
    dashboard: Dashboard = Dashboard()
    recorder: Recorder = Recorder()
    metrics: Metrics = Metrics()
    sim: Sim = Sim()
