"""Credentials of a request: the dashboard's own page only, and from other hosts with the token.

Any web page that is open in the same browser can send requests to ``localhost``, too. It cannot
forge its origin, so the origin must be the dashboard's. Without a token the host name must be a
name of this host: DNS rebinding, which points another name to 127.0.0.1, is refused.
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
class Credentials:
    """The rules for a request; an empty token admits all programs of this host."""

    token: str = ""

    def is_token(self, token: str) -> bool:
        """Return whether this is the token; compared in constant time."""
        return hmac.compare_digest(token.encode(), self.token.encode())

    @property
    def cookie(self) -> str:
        """The value of the cookie: a hash of the token."""
        return hashlib.sha256(f"t2 dashboard {self.token}".encode()).hexdigest()

    def may_view(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request may view the page, by its cookie or by its host."""
        if not self.token:
            return host_name(headers.get("host", "")) in LOCAL_NAMES
        pairs = (pair.strip().partition("=") for pair in headers.get("cookie", "").split(";"))
        cookie = next((value for name, _, value in pairs if name == COOKIE), "")
        return hmac.compare_digest(cookie.encode(), self.cookie.encode())

    def may_act(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request may drive and stop: it must come from the dashboard's page."""
        origin = headers.get("origin", "").partition("://")[2]
        return self.may_view(headers) and bool(origin) and origin == headers.get("host")


def host_name(host: str) -> str:
    """Return the name in a Host header, without its port; empty if it is invalid."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def new_token() -> str:
    """Return a random token."""
    return secrets.token_urlsafe(12)
