"""Prometheus exporter for one robot or many."""
