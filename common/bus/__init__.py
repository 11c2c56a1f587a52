"""Typed Zenoh bus: the only package that imports zenoh.

Zenoh calls back on its own threads. These callbacks only queue the sample and ``post`` it; decoding
and handling happen in the owner's thread. ``docs/adr/0003-zenoh.md`` lists the measurements behind
this design.
"""
