"""Exceptions of the stack; as those of ``t2.errors``, each is a ``T2Error``."""

from t2.errors import T2Error


class WireError(T2Error):
    """A frame that violates the vehicle's protocol."""


class ConfigError(T2Error):
    """A setting that is missing, unknown or out of range."""
