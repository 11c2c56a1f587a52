"""Tests of verification.roaming."""
