"""Who follows a document to the letter sees what it shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.samples import DOCUMENTS, agree, fresh, has_samples, printed, renew

TABLE = "needle  read  score\n------  ----  -----\nn1_pct    20  0.995\n"
SHOWN = [document for document in DOCUMENTS if has_samples(document)]


def test_readme_and_tutorial_show_samples() -> None:
    """The two that a newcomer reads first."""
    assert {"README.md", "tutorial.md"} <= {document.name for document in SHOWN}


@pytest.mark.slow
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


def test_an_excerpt_is_renewed_as_an_excerpt() -> None:
    """What three dots stand for stays left out; where not even the words are there, everything is shown."""
    output = "recording\n" + TABLE.replace("0.995", "0.871") + "flight.csv\n"

    assert fresh("...\nn1_pct 19 0.9\n...\n", output) == "...\nn1_pct    20  0.871\n...\n"
    assert fresh("...\nn2_pct 19 0.9\n", output) == output


def test_a_stale_document_is_renewed(tmp_path: Path) -> None:
    """Below a command, below a fence of commands, from a file that the reader saves; then nothing moves any more."""
    document = tmp_path / "page.md"
    document.write_text(
        "```text saved.txt\n3 m\n```\n```console\n$ cat saved.txt\n2 m\n$ ls fixtures/panel.yaml\n```\n"
        "```\ncat saved.txt\necho 7\n```\nprints\n\n```output\n6\n```\n"
    )

    assert renew(document)
    assert document.read_text() == (
        "```text saved.txt\n3 m\n```\n```console\n$ cat saved.txt\n3 m\n$ ls fixtures/panel.yaml\nfixtures/panel.yaml\n"
        "```\n```\ncat saved.txt\necho 7\n```\nprints\n\n```output\n7\n```\n"
    )
    assert not renew(document)
