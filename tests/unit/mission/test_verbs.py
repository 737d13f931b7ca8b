"""The table of verbs: every word is understood or refused with a sentence."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.errors import RequestError
from robot.mission.verbs import VERBS, numbers, understand


def test_every_verb_is_understood_by_its_own_words_and_with_hyphens():
    for verb in VERBS:
        given_words = ["1" if a.kind == "number" else "mon" for a in verb.arguments]
        for words in (verb.name.split(), [verb.name.replace(" ", "-")], [verb.name]):
            assert understand([*words, *given_words]) == (verb, tuple(given_words))


def test_names_are_unique_and_manuals_are_there():
    assert len({verb.name for verb in VERBS}) == len(VERBS)
    assert all(verb.summary and a.summary for verb in VERBS for a in verb.arguments)
    json.dumps([verb.as_dict() for verb in VERBS])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["dance"], "choose one of"),
        ([], "choose one of"),
        (["go", "to", "1"], "usage: go to X_M Y_M"),
        (["go", "to", "1", "north"], "y_m must be a number"),
        (["go", "to", "1", "nan"], "must be a number"),
        (["go", "to", "1", "1e9"], "must be a number"),
        (["start", "now"], "usage: start"),
        (["clean", "rooms"], "usage"),
        (["clean", "rooms", " "], "empty"),
        (["zone", "add", "rug"], "usage: zone add NAME"),
        (["zone", "add", "rug", "1", "2", "3", "x"], "must be a number"),
        (["clean", "zones", *["1"] * 300], "at most"),
    ],
)
def test_a_mistake_is_told(words, says):
    with pytest.raises(RequestError, match=says):
        understand(words)


@given(st.lists(st.text(max_size=12), max_size=6))
def test_any_words_end_well(words):
    try:
        verb, arguments = understand(words)
    except RequestError as error:
        assert str(error).endswith(".")
    else:
        numbers(a for a, d in zip(arguments, verb.arguments, strict=False) if d.kind == "number")
