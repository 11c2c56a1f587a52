"""The containers as compose.yaml has them, on a real Docker engine: ``python -m tests.compose``."""
