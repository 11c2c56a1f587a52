"""Tests of what two services share."""
