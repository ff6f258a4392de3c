"""Drafts: the panel as drawn so far on the page, as in `panel.yaml`; their errors; and cached alignments.

While gauges are drawn the anchors stay the same, so that frames need not be aligned again: on an oblique panel with ten
anchors, aligning twenty frames takes nine tenths of a trial.
"""

from __future__ import annotations

import re
import threading
import weakref
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from decoder.imaging.alignment import IDENTITY, Alignment
from decoder.imaging.optics import Optics
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import GreyPicture
from decoder.instruments.colours import in_panels_colours
from decoder.instruments.panel_reader import appearance_from_panel
from decoder.panel.camera import Camera
from decoder.panel.description import problems_in
from decoder.panel.errors import DecoderError, PanelError, PictureError
from decoder.panel.gauge import Gauge, stand_in_gauge
from decoder.panel.panel import Panel, parse_content
from decoder.registration.aligner import Aligner
from decoder.registration.anchors import NOTHING_THERE
from decoder.registration.frame_placer import UnwrappedPanel

_GAUGE = re.compile(r"gauges\[(\d+)\]")
_PART = re.compile(r"\w+ (\w+): (.*)")
_FIELD = re.compile(f"`({'|'.join(Gauge.model_fields)})`")
_COLUMN = re.compile(r"would be called (\w+);")
_SUFFIX = re.compile(r"_(status|score|sigma)$")

Document = Mapping[str, Any]
Stale = Callable[[], bool]
"""Tells whether nobody waits for an answer any more."""

DEFAULT_NAME = "panel"
DEFAULT_PICTURE = "panel.jpg"


def field_of(path: str, problem: str, document: Mapping[str, Any]) -> str:
    """Find the field that a problem is about: the one named in it, as far as there is such a field."""
    gauge = _GAUGE.fullmatch(path)
    if gauge is not None:
        return _in_gauge(path, problem, _gauges(document)[int(gauge[1])])
    column = _COLUMN.search(problem)
    if not path and column is not None:
        return _column(column[1], document)
    return path


def _in_gauge(path: str, problem: str, gauge: Mapping[str, Any]) -> str:
    about = _PART.match(problem)
    name, words = about.groups() if about is not None else ("", "")
    for place, part in _named(gauge):
        fields = [word for word in re.findall(r"\w+", words) if word in part]
        if part["name"] == name and fields:
            return f"{path}.{place}.{fields[0]}"
    field = _FIELD.search(problem)
    return f"{path}.{field[1]}" if field is not None else path


def _column(column: str, document: Mapping[str, Any]) -> str:
    """Find the last part of a gauge whose name makes this column."""
    found = ""
    for number, gauge in enumerate(_gauges(document)):
        for place, part in _named(gauge):
            if part["name"] in (column, _SUFFIX.sub("", column)):
                found = f"gauges[{number}].{place}.name"
    return found


def _named(gauge: object) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """List all named parts of a gauge, by their paths; in a draft, a gauge may be anything."""
    if not isinstance(gauge, Mapping):
        return
    for key, value in gauge.items():
        parts = [(f"{key}[{place}]", each) for place, each in enumerate(value)] if isinstance(value, list) else []
        for path, part in [(key, value), *parts]:
            if isinstance(part, Mapping) and "name" in part:
                yield path, part


def _gauges(document: Mapping[str, Any]) -> list[Any]:
    return list(document.get("gauges") or [])


class Superseded(Exception):
    """A later change made a question about a draft pointless."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong at one path of the description, such as `gauges[2].sweep`."""

    path: str
    problem: str


def problems_of(
    document: Document,
    pictures: Mapping[str, GreyPicture],
    camera: Camera | None = None,
    encoded: Mapping[str, bytes] = MappingProxyType({}),
) -> list[Problem]:
    """List everything that keeps a draft from being a panel; empty if it can be saved.

    Parameters
    ----------
    document : the content of `panel.yaml`
    pictures, encoded : by the names that the draft gives them
    """
    found = problems_in(Panel, document, thing="panel")
    if found:
        return [Problem(field_of(path, problem, document), problem) for path, problem in found]
    return _misfits(PanelPictures(parse_content(document), pictures, "", camera, encoded=encoded))


def _misfits(source: PanelPictures) -> list[Problem]:
    """Check against the pictures part by part, so that one fault does not hide another."""
    panel, pictures = source.panel, source.pictures
    missing = [
        Problem(f"gauges[{number}].{path}", f"{name} is not there")
        for number, gauge in enumerate(panel.gauges)
        for path, name in gauge.pictures.items()
        if name not in pictures
    ]
    if missing:
        return missing
    found = []
    try:
        left_out = Aligner(panel, pictures[panel.picture]).left_out
        found += [Problem(f"anchors[{index}].box", NOTHING_THERE) for index in left_out]
    except PanelError as error:
        found.append(Problem(error.path, error.problem))
    for index, gauge in enumerate(panel.gauges):
        one = panel.model_copy(update={"gauges": (gauge,)})
        try:
            appearance_from_panel(UnwrappedPanel(in_panels_colours(replace(source, panel=one))))
        except PanelError as error:
            found.append(Problem(re.sub(r"^gauges\[0\]", f"gauges[{index}]", error.path), error.problem))
    return found


def panel_of_gauge(
    document: Document,
    index: int,
    pictures: Mapping[str, GreyPicture],
    camera: Camera | None,
    encoded: Mapping[str, bytes],
    *,
    memory: AlignmentMemory,
) -> RememberedPanel:
    """Make a panel of one gauge of a draft with everything that locates the panel, ignoring errors in other gauges.

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
        source = RememberedPanel(parse_content(content), pictures, "", camera, encoded=encoded, memory=memory)
    except PanelError as error:
        raise PanelError(re.sub(r"^gauges\[0\]", f"gauges[{index}]", error.path), error.problem) from error
    missing = [name for name in source.panel.pictures if name not in pictures]
    if missing:
        raise PanelError("picture", f"{missing[0]} is not there")
    return source


def aligner_of(document: Document, picture: GreyPicture, optics: Optics, memory: AlignmentMemory) -> Aligner | None:
    """Make the aligner of a draft; None if anchors and level do not suffice yet."""
    height, width = picture.shape
    parts = {key: document[key] for key in ("level", "anchors", "reference_points") if document.get(key)}
    content = {"name": DEFAULT_NAME, "picture": DEFAULT_PICTURE, **parts}
    try:
        panel = parse_content(content | {"gauges": [stand_in_gauge((width / 2, height / 2))]})
        return RememberingAligner(panel, picture, optics, memory)
    except DecoderError:
        return None


Found = Alignment | PictureError
Name = tuple[object, ...]


class AlignmentMemory:
    """What aligners of the same anchors on the same picture found in frames; thread-safe."""

    def __init__(self) -> None:
        self._found: dict[Name, tuple[weakref.ref[GreyPicture], Found]] = {}
        self._lock = threading.Lock()

    def recall(self, name: Name, frame: GreyPicture, find: Callable[[], Alignment]) -> Alignment:
        """Return what was found in a frame before, or find it now; failures are remembered as well."""
        with self._lock:
            seen, found = self._found.get(name, (None, None))
        if seen is None or found is None or seen() is not frame:  # another picture may have reused its memory
            try:
                found = find()
            except PictureError as error:
                found = error
            with self._lock:
                self._found[name] = (weakref.ref(frame), found)
        if isinstance(found, PictureError):
            raise found.with_traceback(None)  # a traceback would keep each caller's frames alive
        return found


class RememberingAligner(Aligner):
    """An aligner that aligns no frame twice."""

    def __init__(self, panel: Panel, picture: GreyPicture, optics: Optics, memory: AlignmentMemory) -> None:
        super().__init__(panel, picture, IDENTITY, optics)
        self._memory = memory

    def align(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        """Do as `Aligner.align`."""
        return self._once("align", super().align, frame, focal_length_mm)

    def search(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        """Do as `Aligner.search`."""
        return self._once("search", super().search, frame, focal_length_mm)

    def align_roughly(self, frame: GreyPicture, focal_length_mm: float | None = None) -> Alignment:
        """Do as `Aligner.align_roughly`."""
        return self._once("roughly", super().align_roughly, frame, focal_length_mm)

    def _once(
        self,
        how: str,
        find: Callable[[GreyPicture, float | None], Alignment],
        frame: GreyPicture,
        focal_length_mm: float | None,
    ) -> Alignment:
        """Do a search once, identified by all that it depends on: of the gauges, only the model that they allow."""
        name = how, id(frame), focal_length_mm, self.usual.elements, self._own.model(self._own.features)
        return self._memory.recall(name, frame, lambda: find(frame, focal_length_mm))


@dataclass(frozen=True, slots=True)
class RememberedPanel(PanelPictures):
    """A panel whose readers share what their aligners have found."""

    memory: AlignmentMemory = field(default_factory=AlignmentMemory)

    def aligner(self) -> Aligner:
        """Make an aligner that shares the memory."""
        return RememberingAligner(self.panel, self.picture, self.optics, self.memory)
