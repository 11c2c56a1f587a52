"""``t2 drive``: drive from this terminal, by keys or gamepad."""

from services.teleop import life

add_arguments = life.add_arguments
run = life.drive
