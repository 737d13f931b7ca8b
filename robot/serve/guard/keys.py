"""Who may come in: a password, named tokens and sessions, none of them kept in clear.

Tokens are 256 random bits, so a plain SHA-256 of them is enough; the password, which a person
chose, is stretched with scrypt (RFC 7914).
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import json
import os
import secrets
import time
from collections.abc import Callable
from pathlib import Path

from robot.errors import ConfigError

MIN_PASSWORD = 8
MAX_PASSWORD = 200
MAX_SESSIONS = 64
SESSION_S = 30 * 24 * 3600
_N, _R, _P = 1 << 13, 8, 1  # 8 MB and some tens of milliseconds on the board


class Keyring:
    """The hashes, and the file (mode 0600) they are kept in; without a file, in memory only."""

    def __init__(self, path: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        """Raises ConfigError when the file exists and cannot be read."""
        self._path, self._clock = path, clock
        self._password = ""
        self._tokens: dict[str, str] = {}  # name -> hash
        self._sessions: dict[str, float] = {}  # hash -> end
        self._link = ""
        if path is not None and path.exists():
            self._load(path)

    @property
    def has_password(self) -> bool:
        """Whether the robot may be reached from other machines."""
        return bool(self._password)

    @property
    def names(self) -> list[str]:
        """Of the tokens."""
        return sorted(self._tokens)

    # ------------------------------------------------------------------ keys

    def set_password(self, password: str) -> None:
        """Raises ConfigError for one that is too short. Everybody who came in before is out."""
        if not MIN_PASSWORD <= len(password) <= MAX_PASSWORD:
            raise ConfigError(
                f"the password has {len(password)} characters; choose {MIN_PASSWORD} to "
                f"{MAX_PASSWORD}."
            )
        salt = secrets.token_bytes(16)
        self._password = f"{salt.hex()}${_stretch(password, salt).hex()}"
        self._sessions.clear()
        self._save()

    def new_token(self, name: str) -> str:
        """A token that is shown once. Raises ConfigError for a bad or taken name."""
        if not name.replace("-", "").replace("_", "").isalnum() or len(name) > 40:
            raise ConfigError(f"token name {name!r}: use up to 40 letters, digits, - and _.")
        if name in self._tokens:
            raise ConfigError(f"token {name!r} exists; revoke it first, or choose another name.")
        token = secrets.token_urlsafe(32)
        self._tokens[name] = _hash(token)
        self._save()
        return token

    def revoke(self, name: str) -> None:
        """Raises ConfigError for an unknown name."""
        if self._tokens.pop(name, None) is None:
            known = ", ".join(self.names) or "none"
            raise ConfigError(f"token {name!r} is unknown; there are: {known}.")
        self._save()

    def new_link(self) -> str:
        """The token of this process's own address, for whoever can read its terminal."""
        token = secrets.token_urlsafe(24)
        self._link = _hash(token)
        return token

    def new_session(self) -> str:
        """A browser's token; the oldest session ends when there are too many."""
        now = self._clock()
        self._sessions = {h: end for h, end in self._sessions.items() if end > now}
        while len(self._sessions) >= MAX_SESSIONS:
            del self._sessions[min(self._sessions, key=self._sessions.__getitem__)]
        token = secrets.token_urlsafe(32)
        self._sessions[_hash(token)] = now + SESSION_S
        self._save()
        return token

    def end_session(self, token: str) -> None:
        """Log one browser out."""
        if self._sessions.pop(_hash(token), None) is not None:
            self._save()

    # ------------------------------------------------------------------ questions

    def admits(self, token: str) -> bool:
        """Whether this is a named token or the process's link."""
        hashed = _hash(token)
        known = [*self._tokens.values(), *([self._link] if self._link else [])]
        return any([hmac.compare_digest(hashed, other) for other in known])

    def admits_session(self, token: str) -> bool:
        """Whether this is a session that has not ended."""
        return self._sessions.get(_hash(token), 0.0) > self._clock()

    def admits_password(self, password: str) -> bool:
        """Slow on purpose. Always False while no password is set."""
        if not self._password or len(password) > MAX_PASSWORD:
            return False
        salt, _, wanted = self._password.partition("$")
        found = _stretch(password, bytes.fromhex(salt))
        return hmac.compare_digest(found, bytes.fromhex(wanted))

    # ------------------------------------------------------------------ the file

    def _load(self, path: Path) -> None:
        try:
            kept = json.loads(path.read_text(encoding="utf-8"))
            self._password = str(kept["password"])
            self._tokens = {str(k): str(v) for k, v in kept["tokens"].items()}
            self._sessions = {str(k): float(v) for k, v in kept["sessions"].items()}
            bytes.fromhex(self._password.replace("$", ""))
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise ConfigError(
                f"{path}: the keys cannot be read ({error}); remove the file and set the password "
                "again."
            ) from None

    def _save(self) -> None:
        if self._path is None:
            return
        kept = {"password": self._password, "tokens": self._tokens, "sessions": self._sessions}
        beside = self._path.with_name(f".{self._path.name}.{os.getpid()}")
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with open(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w") as file:
                json.dump(kept, file)
                file.flush()
                os.fsync(file.fileno())
            beside.replace(self._path)
        except OSError as error:
            with contextlib.suppress(OSError):
                beside.unlink()
            raise ConfigError(
                f"{self._path}: cannot be written ({error.strerror}); give a writable --state."
            ) from None


def _hash(token: str) -> str:
    return hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()


def _stretch(password: str, salt: bytes) -> bytes:
    return hashlib.scrypt(password.encode("utf-8", "replace"), salt=salt, n=_N, r=_R, p=_P)
