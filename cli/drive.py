"""``t2 drive``: drive from this terminal, by keys or gamepad."""

from services.teleop import __main__ as teleop

add_arguments = teleop.add_arguments
run = teleop.drive
