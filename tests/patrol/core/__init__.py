"""Tests of what patrol decides."""
