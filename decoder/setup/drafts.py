"""Drafts: what the page has drawn so far, in the words of `panel.yaml`, and what is still wrong with it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from decoder.aligner import Aligner
from decoder.camera import Camera
from decoder.description import problems_in
from decoder.errors import DecoderError, PanelError
from decoder.optics import Optics
from decoder.panel import Panel, parse_content
from decoder.panel_pictures import PanelPictures
from decoder.panel_tuning import tuning_from_panel
from decoder.pictures import GreyPicture
from decoder.setup.placing import field_of
from decoder.unwrapped_panel import UnwrappedPanel

Document = Mapping[str, Any]

DEFAULT_NAME = "panel"
DEFAULT_PICTURE = "panel.jpg"


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong at one path of the description, such as `gauges[2].sweep`."""

    path: str
    problem: str


def problems_of(document: Document, pictures: Mapping[str, GreyPicture], camera: Camera | None = None) -> list[Problem]:
    """Everything that keeps a draft from being a panel; none if it can be saved.

    Parameters
    ----------
    document : the content of `panel.yaml`
    pictures : by the names that the draft gives them
    """
    found = problems_in(Panel, document, thing="panel")
    if found:
        return [Problem(field_of(path, problem, document), problem) for path, problem in found]
    return _misfits(parse_content(document), pictures, camera)


def _misfits(panel: Panel, pictures: Mapping[str, GreyPicture], camera: Camera | None) -> list[Problem]:
    """What does not fit the pictures, part by part, so that one fault does not hide another."""
    missing = [
        Problem(f"gauges[{number}].needles[{place}].template.picture", f"{needle.template.picture} is not there")
        for number, gauge in enumerate(panel.gauges)
        for place, needle in enumerate(gauge.needles)
        if needle.template.picture is not None and needle.template.picture not in pictures
    ]
    if missing:
        return missing
    found = []
    try:
        Aligner(panel, pictures[panel.picture])
    except PanelError as error:
        found.append(Problem(error.path, error.problem))
    for index, gauge in enumerate(panel.gauges):
        one = panel.model_copy(update={"gauges": (gauge,)})
        try:
            tuning_from_panel(UnwrappedPanel(PanelPictures(one, pictures, "", camera)))
        except PanelError as error:
            found.append(Problem(re.sub(r"^gauges\[0\]", f"gauges[{index}]", error.path), error.problem))
    return found


def panel_of_gauge(
    document: Document, index: int, pictures: Mapping[str, GreyPicture], camera: Camera | None = None
) -> PanelPictures:
    """One gauge of a draft with all that finds the panel, whatever is wrong with the other gauges.

    Raises
    ------
    PanelError
        Naming what is wrong, with its path in the whole draft.
    """
    gauges = document.get("gauges")
    if not isinstance(gauges, list) or not 0 <= index < len(gauges):
        raise PanelError("gauges", "has no such gauge")
    content = {"name": DEFAULT_NAME, "picture": DEFAULT_PICTURE, **document, "gauges": [gauges[index]]}
    try:
        source = PanelPictures(parse_content(content), pictures, "", camera)
    except PanelError as error:
        raise PanelError(re.sub(r"^gauges\[0\]", f"gauges[{index}]", error.path), error.problem) from error
    missing = [name for name in source.panel.pictures if name not in pictures]
    if missing:
        raise PanelError("picture", f"{missing[0]} is not there")
    return source


def stand_in_gauge(centre: tuple[float, float]) -> dict[str, Any]:
    """A gauge that does no more than make a panel of anchors and level: what finds the panel needs no dials."""
    needle = {"name": "stand_in", "template": {"at": 0.0, "span": 4.0}}
    return {
        "name": "stand-in",
        "centre": list(centre),
        "radius": [2.0, 6.0],
        "sweep": [0.0, 90.0],
        "scale": [[0.0, 0.0], [90.0, 1.0]],
        "needles": [needle],
    }


def aligner_of(document: Document, picture: GreyPicture, optics: Optics) -> Aligner | None:
    """What finds a draft's panel in frames; None where anchors and level do not suffice yet."""
    height, width = picture.shape
    parts = {key: document[key] for key in ("level", "anchors", "reference_points") if document.get(key)}
    content = {"name": DEFAULT_NAME, "picture": DEFAULT_PICTURE, **parts}
    try:
        panel = parse_content(content | {"gauges": [stand_in_gauge((width / 2, height / 2))]})
        return Aligner(panel, picture, optics=optics)
    except DecoderError:
        return None
