"""Write docs/reference: `python -m docs_pages`, or `make reference`."""

from __future__ import annotations

from pathlib import Path

from docs_pages.reference import pages

FOLDER = Path(__file__).parents[1] / "docs" / "reference"

if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
        print(FOLDER / name)
