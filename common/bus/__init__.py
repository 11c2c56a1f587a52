"""Typed Zenoh bus: the only package that imports zenoh, beside ``services.ros2.endpoints``.

Zenoh calls back on its own threads. These callbacks stamp and queue the sample and submit its
handling to the owner's loop, which admits one thread at a time. The section "Bus" of
``docs/decisions.md`` gives the reasons and measurements.
"""
