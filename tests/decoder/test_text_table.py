"""Text tables: aligned whatever stands in them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from decoder.text_table import text_table

CELLS = st.from_regex(r"\A[a-z0-9.%-]{1,12}\Z")


def test_columns_are_aligned() -> None:
    """The first column stands to the left, the others to the right, two blanks between them."""
    table = text_table(["needle", "read"], [["n1", "7"], ["fuel_al_lb", "12"]])

    assert table.splitlines() == ["needle      read", "----------  ----", "n1             7", "fuel_al_lb    12"]


def test_table_without_rows_is_a_header() -> None:
    """With nothing to show the header still stands over its rule."""
    assert text_table(["needle", "read"], []) == "needle  read\n------  ----"


@given(
    rows=st.integers(1, 5).flatmap(lambda width: st.lists(st.lists(CELLS, min_size=width, max_size=width), min_size=1))
)
def test_cells_come_back_and_end_in_line(rows: list[list[str]]) -> None:
    """Splitting a line at blanks gives its cells, and every cell but the first ends where its column's rule ends."""
    header, rule, *lines = text_table(rows[0], rows[1:]).splitlines()
    ends = [place for place in range(1, len(rule) + 1) if rule[place - 1] == "-" and rule[place : place + 1] != "-"]

    assert [line.split() for line in (header, *lines)] == rows
    for line in (header, *lines):
        assert not line.endswith(" ")
        assert all(line[end - 1] != " " for end in ends[1:])
