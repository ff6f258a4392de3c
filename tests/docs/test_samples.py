"""Who follows a document to the letter sees what it shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.samples import DOCUMENTS, agree, fresh, has_samples, printed

TABLE = "needle  read  score\n------  ----  -----\nn1_pct    20  0.995\n"
SHOWN = [document for document in DOCUMENTS if has_samples(document)]


def test_readme_and_tutorial_show_samples() -> None:
    """The two that a newcomer reads first."""
    assert {"README.md", "tutorial.md"} <= {document.name for document in SHOWN}


@pytest.mark.slow
@pytest.mark.untraced
@pytest.mark.parametrize("document", SHOWN, ids=lambda path: path.name)
def test_commands_print_what_the_document_shows(document: Path, tmp_path: Path) -> None:
    """Every command, one after the other; if the change is meant, `make docs-samples` renews what is shown."""
    for sample, output in printed(document.read_text(encoding="utf-8"), tmp_path):
        found = fresh(sample.shown, output)
        assert agree(sample.shown, found), f"{sample.command}\n{found}\ninstead of\n{sample.shown}"


@pytest.mark.parametrize(
    ("printed_now", "same"),
    [
        (TABLE, True),
        (TABLE.replace("0.995", "0.996"), True),
        (TABLE.replace("0.995", "0.997"), False),
        (TABLE.replace("20", "19"), False),
        (TABLE.replace("0.995", "-"), False),
        (TABLE.replace("  20", "    20").replace("read", "  read").replace("----  ", "------  "), True),
        (TABLE + "n2_pct    20  0.995\n", False),
    ],
)
def test_only_rounding_is_forgiven(printed_now: str, *, same: bool) -> None:
    """One in a number's last decimal and a column's width, and nothing else."""
    assert agree(TABLE, fresh(TABLE, printed_now)) is same
