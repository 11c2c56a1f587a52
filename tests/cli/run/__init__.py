"""Tests of supervisor, router and installation."""
