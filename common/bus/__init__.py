"""Typed Zenoh bus: the only package that imports zenoh, beside ``services.ros2.endpoints``.

Zenoh calls back on its own threads. These callbacks stamp and queue what arrives; the owner's loop
handles it. The section "Bus" of ``docs/decisions.md`` gives the reasons and measurements.
"""
