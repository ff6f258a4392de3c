"""What the documents have from the code: `python -m docs_pages` writes docs/reference."""
