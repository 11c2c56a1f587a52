"""Tests that run the programs of the documents."""
