"""What all tests of the decoder share."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from decoder.imaging.panel_pictures import PanelPictures
from decoder.instruments.panel_reader import PanelReader
from tests.decoder.cockpit import DOCUMENT, reader_of, source_of


@pytest.fixture
def document() -> dict[str, Any]:
    """The content of the drawn cockpit's `panel.yaml`, free to be spoilt."""
    return copy.deepcopy(DOCUMENT)


@pytest.fixture
def panel(document: dict[str, Any]) -> PanelPictures:
    """The drawn cockpit's panel."""
    return source_of(document)


@pytest.fixture(scope="session")
def reader() -> PanelReader:
    """A reader of the drawn cockpit as it is."""
    return reader_of()
