"""Keys: nothing in clear on the disk, nothing that opens twice what was closed."""

import json
import stat

import pytest

from robot.errors import ConfigError
from robot.serve.guard.keys import MAX_SESSIONS, SESSION_S, Keyring


def test_what_is_kept_does_not_open_anything(tmp_path):
    path = tmp_path / "keys.json"
    keys = Keyring(path)
    keys.set_password("correct horse")
    token, session = keys.new_token("phone"), keys.new_session()
    text = path.read_text()
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    for secret in ("correct horse", token, session):
        assert secret not in text
    for kept in [*json.loads(text)["tokens"].values(), *json.loads(text)["sessions"]]:
        assert not keys.admits(kept) and not keys.admits_session(kept)


def test_keys_survive_a_restart(tmp_path):
    path = tmp_path / "keys.json"
    first = Keyring(path)
    first.set_password("correct horse")
    token, session = first.new_token("phone"), first.new_session()
    again = Keyring(path)
    assert again.admits(token) and again.admits_session(session)
    assert again.admits_password("correct horse") and not again.admits_password("correct hors")


def test_a_revoked_token_a_new_password_and_time_close_doors():
    now = [1000.0]
    keys = Keyring(clock=lambda: now[0])
    token, session = keys.new_token("phone"), keys.new_session()
    keys.revoke("phone")
    assert not keys.admits(token) and keys.admits_session(session)
    now[0] += SESSION_S + 1
    assert not keys.admits_session(session)
    session = keys.new_session()
    keys.set_password("another one")
    assert not keys.admits_session(session)


def test_sessions_are_bounded_and_the_oldest_goes():
    now = [0.0]
    keys = Keyring(clock=lambda: now[0])
    sessions = []
    for _ in range(MAX_SESSIONS + 1):
        now[0] += 1
        sessions.append(keys.new_session())
    assert not keys.admits_session(sessions[0]) and keys.admits_session(sessions[-1])


def test_nothing_opens_an_empty_ring():
    keys = Keyring()
    for nothing in ("", "null", "$"):
        assert not keys.admits(nothing) and not keys.admits_session(nothing)
        assert not keys.admits_password(nothing)


@pytest.mark.parametrize("password", ["short", "x" * 1000])
def test_bad_passwords_are_refused_with_the_remedy(password):
    with pytest.raises(ConfigError, match="choose 8 to 200"):
        Keyring().set_password(password)


def test_names_are_unique_and_plain():
    keys = Keyring()
    keys.new_token("phone")
    with pytest.raises(ConfigError, match="exists"):
        keys.new_token("phone")
    with pytest.raises(ConfigError, match="letters"):
        keys.new_token("../phone")
    with pytest.raises(ConfigError, match="there are: phone"):
        keys.revoke("tablet")


@pytest.mark.parametrize("text", ["", "[]", "{", '{"password": "a", "tokens": [], "sessions": 1}'])
def test_a_damaged_file_is_explained(tmp_path, text):
    path = tmp_path / "keys.json"
    path.write_text(text)
    with pytest.raises(ConfigError, match="remove the file"):
        Keyring(path)
