"""Typed Zenoh bus: the only package that imports zenoh, beside ``services.ros2.endpoints``.

Zenoh calls back on its own threads. These callbacks stamp and queue the sample and submit its
handling to the owner's loop, which admits one thread at a time (``docs/adr/0002-one-thread.md``).
``docs/adr/0003-zenoh.md`` lists the measurements behind this design.
"""
