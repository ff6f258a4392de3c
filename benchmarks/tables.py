"""Tables as Markdown, which reads well on a terminal too."""

from __future__ import annotations

from collections.abc import Sequence

Rows = Sequence[Sequence[str]]


def markdown(header: Sequence[str], rows: Rows) -> str:
    """A table; the first column to the left, the others to the right."""
    widths = [max(len(row[column]) for row in [header, *rows]) for column in range(len(header))]
    dashes = ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])]
    return "\n".join(
        "| "
        + " | ".join([row[0].ljust(widths[0]), *(f"{c:>{w}}" for c, w in zip(row[1:], widths[1:], strict=True))])
        + " |"
        for row in [header, dashes, *rows]
    )


def number(value: float | None, decimals: int = 4, *, sign: bool = False) -> str:
    """A number, or a dash for none."""
    return "-" if value is None else f"{value:{'+' if sign else ''}.{decimals}f}"
