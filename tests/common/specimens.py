"""How tests start the service ``tests.common.specimen``."""

SPECIMEN = "tests.common.specimen"


def on(endpoint: str, robot: str) -> list[str]:
    """Return the options that put a service on a router."""
    return ["--set", f"bus.connect={endpoint}", "--set", f"robot.id={robot}"]
