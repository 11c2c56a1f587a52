"""``t2 dashboard``: show, drive and stop robots in a browser."""

from services.dashboard import __main__ as dashboard

add_arguments = dashboard.add_arguments
run = dashboard.run
