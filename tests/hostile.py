"""Documents of strangers: any values in them replaced by what is most often not thought of."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

Change = tuple[int, Any]
Place = tuple[str | int, ...]

SPECIAL: tuple[Any, ...] = (
    None, True, False, 0, 1, 2, -1, 0.5, 16, 359.999, 360, 361, -360, 1e5, -1e5, 1e12, 1e-9, 1e-12, 1e-300, 5e-324,
    1e308, -1e308, float("nan"), float("inf"), 10**30, 10**400, "", "nan", "9" * 5000, "1e999", "x" * 5000, "a\nb",
    "a\0b", "\ud800", "=cmd()", "<b>", "../x", "panel.yaml", [], {}, [[]], [1], [1, 2], [1, 2, 3], [0, 0], [5, 5],
    [0.0, 1e-9], [1e5, 1e5], [[0, 0], [0, 0]], [[0, 0], [1, 1], [2, 2]], [[0, 0]] * 5, [[10, 10]] * 5,
    [[1, 2, 3]] * 5, [[5, 5]] * 60, [[0, 0], [1e-9, 1e-9]], {"a": 1}, {"x" * 5000: 1}, {"\ud800": 1}, {"\x1b": {}},
)  # fmt: skip


def changes(*own: Any) -> st.SearchStrategy[list[Change]]:  # noqa: ANN401 - what YAML or JSON holds
    """Up to two values of a document are replaced, perhaps by one of a test's own."""
    numbers = st.floats() | st.integers() | st.lists(st.floats(-2000, 2000), max_size=4)
    return st.lists(st.tuples(st.integers(0, 10_000), st.sampled_from((*SPECIAL, *own)) | numbers), max_size=2)


def places(node: object, at: Place = ()) -> Iterator[Place]:
    """Where values stand in a document, lists and mappings too."""
    if at:
        yield at
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, below in items:
        yield from places(below, (*at, key))


def spoilt(content: Any, replaced: list[Change]) -> Any:  # noqa: ANN401 - what YAML or JSON holds
    """A document with some values replaced; the numbers choose which."""
    whole = copy.deepcopy(content)
    for number, value in replaced:
        there = list(places(whole))
        *parents, last = there[number % len(there)]
        owner = whole
        for key in parents:
            owner = owner[key]
        owner[last] = copy.deepcopy(value)
    return whole
