"""Lap after lap with random faults and kill -9, watching memory and more: ``make soak``."""
