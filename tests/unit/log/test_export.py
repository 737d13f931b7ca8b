"""Tracks in the formats of others."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.errors import LogError
from robot.log.export import read_tum, write_tum

number = st.floats(-100.0, 100.0)
rows = st.tuples(st.floats(0.0, 1e6), number, number, st.floats(-3.14, 3.14))


@given(st.lists(rows, max_size=5))
def test_tum_text_reads_back(track: list[tuple[float, float, float, float]]) -> None:
    wanted = np.array(track).reshape(-1, 4)
    np.testing.assert_allclose(read_tum(write_tum(wanted)), wanted, atol=1e-6)


def test_a_tum_line_is_what_other_tools_expect() -> None:
    lines = write_tum(np.array([[1.5, 2.0, -3.0, math.pi / 2]])).splitlines()
    assert lines[0].startswith("#")
    assert [float(word) for word in lines[1].split()] == pytest.approx(
        [1.5, 2.0, -3.0, 0, 0, 0, math.sqrt(0.5), math.sqrt(0.5)]
    )


@pytest.mark.parametrize("line", ["1 2 3", "1 2 3 4 5 6 7 x", "nan 0 0 0 0 0 0 1"])
def test_other_lines_are_refused_by_number(line: str) -> None:
    with pytest.raises(LogError, match=r"gt\.txt, line 2"):
        read_tum(f"# head\n{line}\n", "gt.txt")
