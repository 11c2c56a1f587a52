"""How tests start the service ``tests.common.example_service``."""

SPECIMEN = "tests.common.example_service"


def on(endpoint: str, robot: str) -> list[str]:
    """Return the options that put a service on a router."""
    return ["--set", f"bus.connect={endpoint}", "--set", f"robot.id={robot}"]
