"""What people set: understood, refused with the choices, kept."""

import pytest

from robot.errors import MapError, RequestError
from robot.mission.settings import FAN_SHARES, Settings


@pytest.mark.parametrize("level", [*FAN_SHARES, "MAX", " Low "])
def test_every_level_is_understood_and_kept(level):
    settings = Settings()
    settings.set_fan(level)
    assert Settings.from_dict(settings.to_dict()) == settings
    assert 0.0 <= settings.fan_share <= 1.0


def test_a_level_that_does_not_exist_changes_nothing():
    settings = Settings("low")
    with pytest.raises(RequestError, match="off, low, medium, high"):
        settings.set_fan("turbo")
    assert settings == Settings("low")


@pytest.mark.parametrize("plain", [{"fan": "turbo"}, {"fan": 1}, {"fan": []}, [], None])
def test_settings_that_make_no_sense_are_refused(plain):
    with pytest.raises(MapError, match="fan level"):
        Settings.from_dict(plain, "home.npz")


def test_a_map_of_before_there_were_settings_has_those_of_the_first_day():
    assert Settings.from_dict({}) == Settings()
