"""What all tests of the decoder share."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from decoder.instruments.panel_reader import PanelReader
from tests.decoder.cockpit import DOCUMENT, reader_of


@pytest.fixture
def document() -> dict[str, Any]:
    """The content of the drawn cockpit's `panel.yaml`, free to be spoilt."""
    return copy.deepcopy(DOCUMENT)


@pytest.fixture(scope="session")
def reader() -> PanelReader:
    """A reader of the drawn cockpit as it is."""
    return reader_of()
