"""The containers of compose.yaml on a real Docker engine: ``python -m verification.containers``."""
