"""Tests of t2 fit."""
