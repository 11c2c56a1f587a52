"""Which T2 this is."""

# As in `pyproject.toml`; the metadata of the installed package take 20 ms to find.
VERSION = "0.1.0"
