"""The page for who has no key yet: whole in itself, as nothing else may be loaded without one."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LoginPage:
    """Its text, and the content policy that lets exactly its own script and style run."""

    html: str
    policy: str


def login_page(html: str) -> LoginPage:
    """Allow the inline parts by their hashes (CSP level 3)."""
    allowed = {
        kind: " ".join(
            f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
            for text in re.findall(rf"<{kind}>(.*?)</{kind}>", html, re.DOTALL)
        )
        for kind in ("script", "style")
    }
    policy = (
        f"default-src 'none'; script-src {allowed['script']}; style-src {allowed['style']}; "
        "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    )
    return LoginPage(html, policy)
