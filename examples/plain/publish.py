"""Publish data of your own below app/NAME twice a second; every program on the bus may read it."""

import itertools
import time

import msgpack
from robot_bus import ROOT, open_session

NAME = "planner"  # of your program; from another computer the name of its certificate

with open_session() as session:
    route = session.declare_publisher(f"{ROOT}/app/{NAME}/route", encoding="application/msgpack")
    for number in itertools.count():
        route.put(msgpack.packb({"number": number, "next": [1.5, 0.0]}))
        time.sleep(0.5)
