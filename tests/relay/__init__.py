"""Tests of the relay, which imports nothing of T2: frames are built by ``common.wire``."""
