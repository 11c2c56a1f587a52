"""Tests of the proof of t2 fit."""
