"""Zenoh, typed: the only package that imports it.

Zenoh calls back on its own threads. Those calls only queue what came and ``post`` it; decoding and
handling happen in the owner's thread. What was measured of Zenoh and shapes this package stands in
``docs/adr/0003-zenoh.md``.
"""
