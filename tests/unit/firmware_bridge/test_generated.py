"""The generated header and page are those of the table."""

from __future__ import annotations

import pytest

from firmware_bridge.generate import HEADER, PAGE, header, page, snake, table
from firmware_bridge.messages import MESSAGES

REMEDY = "run `python -m firmware_bridge.messages`"


def test_header_is_fresh() -> None:
    assert HEADER.read_text(encoding="utf-8") == header(), REMEDY


def test_page_is_fresh() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert page(text) == text, REMEDY
    assert table() in text


def test_every_message_and_field_is_in_the_header() -> None:
    text = header()
    for ident, spec in MESSAGES.items():
        name = snake(spec.cls.__name__).upper()
        assert f"#define WIRE_ID_{name} {ident}u\n" in text
        assert f"#define WIRE_SIZE_{name} {spec.size}u\n" in text
        for field in spec.fields:
            assert f"    {field.ctype.name} {field.name}; /*" in text


@pytest.mark.parametrize("spec", MESSAGES.values(), ids=lambda s: s.cls.__name__)
def test_the_sender_shows_in_the_id(spec) -> None:  # type: ignore[no-untyped-def]
    assert (spec.ident < 64) == (spec.sender == "host")
