"""The page of a round: taught and driven path, uncertainty, stations and halts."""

from functools import partial

from cli.page import fill_page
from cli.patrol.calls import duration, local
from common.cli_args import needs_extra
from t2 import messages as m
from t2.words import Language, render


def page(reply: m.RoundsReply, language: Language) -> str:
    """Return the page of a round; its route and track may be missing."""
    with needs_extra("report", "a report"):
        from cli.patrol import figures
    found, route, track = reply.rounds[0], reply.route, reply.track
    return fill_page(
        "patrol/round.html",
        {"local": local, "said": partial(said, language=language)},
        title=f"Round {found.id}",
        found=found,
        about=about(found, route),
        path=figures.path(found, route, track) if route is not None else "",
        uncertainty=figures.uncertainty(route, track) if route is not None and track else "",
    )


def said(it: m.Round | m.Halt, language: Language) -> str:
    """Return the text of a round or a halt."""
    return render(it.phrases, language, it.text)


def about(found: m.Round, route: m.Route | None) -> dict[str, str]:
    """Return what a round was, by name."""
    return {
        "route": found.route,
        "robot": found.robot,
        "schedule": found.schedule,
        "begin": local(found.start_ns),
        "end": local(found.end_ns) if found.end_ns else "",
        "time": f"{duration(found.start_ns, found.end_ns)} min" if found.end_ns else "",
        "driven": f"{found.distance:.1f} m",
        "corridor": f"{route.corridor:.2f} m to either side" if route is not None else "",
        "greatest deviation": f"{found.deviation:.2f} m",
        "greatest sigma": f"{found.sigma:.2f} m across the route",
        "least margin": f"{found.margin:.2f} m" if found.margin is not None else "",
        "recordings": ", ".join(found.recordings),
    }
