"""Who may come in: the browser's own page only, and beyond this machine only with the token.

A web page of anybody's, open in the same browser, can reach ``localhost``, too. It cannot lie about
its origin, so that has to be ours; and where no token is asked for, the host has to be this machine
by name, so that a name that somebody else bends to 127.0.0.1 opens nothing.
"""

import hashlib
import hmac
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

COOKIE = "t2_dashboard"
TOKEN_MIN = 8
LOCAL_NAMES = ("localhost", "127.0.0.1", "::1")


@dataclass(frozen=True, slots=True)
class Gate:
    """The rule; an empty token lets in whoever is on this machine."""

    token: str = ""

    def knows(self, token: str) -> bool:
        """Tell whether this is the token, in a time that does not tell how much of it is right."""
        return hmac.compare_digest(token.encode(), self.token.encode())

    @property
    def badge(self) -> str:
        """What the cookie holds: it proves the token and does not show it."""
        return hashlib.sha256(f"t2 dashboard {self.token}".encode()).hexdigest()

    def lets_in(self, headers: Mapping[str, str]) -> bool:
        """Tell whether a request may see the page, by its cookie or by where it comes from."""
        if not self.token:
            return host_name(headers.get("host", "")) in LOCAL_NAMES
        pairs = (pair.strip().partition("=") for pair in headers.get("cookie", "").split(";"))
        badge = next((value for name, _, value in pairs if name == COOKIE), "")
        return hmac.compare_digest(badge.encode(), self.badge.encode())

    def lets_act(self, headers: Mapping[str, str]) -> bool:
        """Tell whether it may drive and stop, too: it has to come from our own page."""
        origin = headers.get("origin", "").partition("://")[2]
        return self.lets_in(headers) and bool(origin) and origin == headers.get("host")


def host_name(host: str) -> str:
    """Return a Host header's name, without its port; empty when it is none."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def new_token() -> str:
    """Return a token that nobody guesses."""
    return secrets.token_urlsafe(12)
