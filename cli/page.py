"""HTML pages of reports, with one style: each template fills ``page.html``. Extra ``report``."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from common.cli_args import needs_extra

FOLDER = Path(__file__).parent


def fill_page(template: str, filters: dict[str, Callable[..., str]], **values: Any) -> str:
    """Return a page, with all values escaped; ``template`` is a file below ``cli``."""
    with needs_extra("report", "a report"):
        from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.filters |= filters
    return environment.get_template(template).render(**values)
