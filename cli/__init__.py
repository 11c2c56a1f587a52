"""The ``t2`` command."""
