"""What cannot be counted here."""


class Uncountable(Exception):  # noqa: N818 - it is no error: a tool is missing
    """Why something cannot be counted on this machine."""
