"""``t2 dashboard``: see it, drive it and stop it in a browser."""

from services.dashboard import life

add_arguments = life.add_arguments
run = life.run
