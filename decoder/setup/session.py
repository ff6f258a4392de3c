"""One set-up: the flight it is drawn on, the panel that was opened, where it is saved, and which tab may save it."""

from __future__ import annotations

import json
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from decoder.aligner import Aligner
from decoder.alignment import Alignment
from decoder.attachments import CAMERA_FILE, PANEL_FILE
from decoder.camera import Camera, parse_camera
from decoder.errors import DecoderError, PanelError, PictureError
from decoder.panel_pictures import PanelPictures, panel_from_attachments, panel_from_file
from decoder.pictures import FramePicture, GreyPicture, grey_picture
from decoder.setup.drafts import Document, Problem, aligner_of, problems_of
from decoder.setup.drawn_plane import Planes
from decoder.setup.picture_store import PANEL_KEY, PictureStore
from decoder.setup.remembering import AlignmentMemory, RememberedPanel
from decoder.setup.saving import digest, plain_name, save_files
from decoder.setup.sources import FlightSource, PictureSource
from decoder.setup.trial import Superseded
from decoder.setup.yaml_text import panel_text

KEPT_ALIGNMENTS = 8
Aligned = list[tuple[GreyPicture, Alignment]]


class SavedElsewhere(DecoderError):
    """Another tab or program saved the panel since this one opened it."""


class NotValid(DecoderError):
    """The draft is no panel yet."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = problems
        super().__init__(f"{len(problems)} thing(s) to put right before the panel can be saved")


class SetupSession:
    """What the page's server knows; safe to use from several threads.

    Parameters
    ----------
    source
        The flight or the picture.
    panel_file
        The panel to open; a new one is begun if it is not there. If None, the flight's own is opened.
    target
        Where the panel is saved, its pictures beside it.
    camera
        That took the pictures; if None, the one that the flight carries.
    """

    def __init__(
        self, source: PictureSource, panel_file: Path | None, target: Path, *, camera: Camera | None = None
    ) -> None:
        self.source, self.target = source, target
        self.revision = 0
        self.opened_from, document, self._pictures = _opened(source, panel_file)
        panel_picture = self._pictures.get(str(document.get("picture"))) if document else None
        self.store = PictureStore(source, panel_picture)
        self.picture_key = PANEL_KEY if panel_picture is not None else f"frame-{source.sample[0]}"
        self.document: dict[str, Any] = document or _empty(source)
        self.camera = camera or _camera(source)
        self._digest = digest(target)
        self._aligned: OrderedDict[str, Aligned] = OrderedDict()
        self._memories: OrderedDict[str, AlignmentMemory] = OrderedDict()
        self._lock = threading.Lock()

    def pictures(self, document: Document, key: str) -> dict[str, GreyPicture]:
        """The grey pictures that a draft names, its panel picture being the one under `key`."""
        named = {name: grey_picture(encoded) for name, encoded in self._template_pictures(document).items()}
        return {**named, str(document.get("picture", "panel.jpg")): self.store.grey(key)}

    def problems(self, document: Document, key: str) -> list[Problem]:
        """What keeps a draft from being saved."""
        found = problems_of(document, self.pictures(document, key), self.camera)
        try:
            plain_name(str(document.get("picture", "")), "picture")
        except PanelError as error:
            found.append(Problem(error.path, error.problem))
        return found

    def save(self, document: Document, key: str, revision: int) -> int:
        """Saves a draft; the number of the new revision.

        Raises
        ------
        SavedElsewhere
            If it was saved since the revision that the draft is based on.
        NotValid
            With everything that is wrong.
        OutputError
            If the disk does not take it.
        """
        with self._lock:
            if revision != self.revision or digest(self.target) != self._digest:
                raise SavedElsewhere(
                    "this panel was saved from somewhere else meanwhile; load that one, or save anyway"
                )
            problems = self.problems(document, key)
            if problems:
                raise NotValid(problems)
            files = {plain_name(name, "picture"): data for name, data in self._template_pictures(document).items()}
            files[str(document["picture"])] = self.store.encoded(key)
            save_files(self.target.parent, {**files, self.target.name: panel_text(document).encode("utf-8")})
            self._digest = digest(self.target)
            self.document, self.picture_key = dict(document), key
            self.revision += 1
            return self.revision

    def accept_others(self) -> int:
        """Takes note of what was saved from elsewhere, so that it may be saved over; the revision to name then."""
        with self._lock:
            self._digest = digest(self.target)
            return self.revision

    def planes(self, document: Document, key: str) -> Planes:
        """What a draft tells of how its dials are seen in the picture under `key`."""
        height, width = self.store.grey(key).shape
        return Planes.of(document, (width, height), self.camera)

    def aligner(self, document: Document, key: str) -> Aligner | None:
        """What finds a draft's panel in the flight's frames, if anchors and level suffice."""
        return aligner_of(document, self.store.grey(key), self.planes(document, key).optics)

    def aligned(self, document: Document, key: str, stale: Callable[[], bool]) -> Aligned:
        """The sample's frames in which the panel is found; without anchors they are taken as they are.

        Raises
        ------
        Superseded
            If the question became stale meanwhile.
        """
        name = _finding(document, key)
        with self._lock:
            if name in self._aligned:
                return self._aligned[name]
        aligner = self.aligner(document, key)
        picture, own = self.store.grey(key), self.planes(document, key).optics.own
        found: Aligned = []
        for _, taken in self.frames():
            if stale():
                raise Superseded
            alignment = _where(aligner, taken, own) if taken.pixels.shape == picture.shape else None
            if alignment is not None:
                found.append((taken.pixels, alignment))
        with self._lock:
            self._aligned[name] = found
            while len(self._aligned) > KEPT_ALIGNMENTS:
                self._aligned.popitem(last=False)
        return found

    def remembered(self, source: PanelPictures, document: Document, key: str) -> RememberedPanel:
        """A draft's panel with what was found in frames by the same anchors before."""
        name = _finding(document, key)
        with self._lock:
            memory = self._memories.setdefault(name, AlignmentMemory())
            self._memories.move_to_end(name)
            while len(self._memories) > KEPT_ALIGNMENTS:
                self._memories.popitem(last=False)
        return RememberedPanel(source.panel, source.pictures, source.sha256, source.camera, source.planes, memory)

    def frames(self) -> list[tuple[int, FramePicture]]:
        """The sample's frames that can be decompressed, with their numbers."""
        found = []
        for index in self.source.sample:
            try:
                found.append((index, self.frame(f"frame-{index}")))
            except PictureError:
                continue  # `decode` reports it
        return found

    def frame(self, key: str) -> FramePicture:
        """The picture under a key, and its zoom if it is one of the flight's."""
        grey = self.store.grey(key)
        number = key.removeprefix("frame-")
        return FramePicture(grey, self.source.focal_length_mm(int(number)) if number != key else None)

    def _template_pictures(self, document: Document) -> Mapping[str, bytes]:
        """The pictures besides the panel picture that a draft names, as far as there are any of that name."""
        named = [template.get("picture") for template in _templates(document)]
        return {
            name: self._pictures[name] for name in named if name in self._pictures and name != document.get("picture")
        }


def _finding(document: Document, key: str) -> str:
    """All that finding the panel in frames depends on."""
    parts = ("anchors", "level", "reference_points", "focal_length_mm")
    return json.dumps([key, *(document.get(part) for part in parts)])


def _templates(document: Document) -> Iterator[dict[str, Any]]:
    """The templates of a draft, whatever else is wrong with it."""
    for gauge in _mappings(document.get("gauges")):
        for needle in _mappings(gauge.get("needles")):
            yield from _mappings([needle.get("template")])


def _mappings(items: object) -> list[dict[str, Any]]:
    return [item for item in items if isinstance(item, dict)] if isinstance(items, list) else []


def _where(aligner: Aligner | None, frame: FramePicture, own: Alignment) -> Alignment | None:
    if aligner is None:
        return own
    try:
        return aligner.align(frame.pixels, frame.focal_length_mm)
    except PictureError:
        return None


def _opened(source: PictureSource, panel_file: Path | None) -> tuple[str, dict[str, Any] | None, dict[str, bytes]]:
    """Where a panel was opened from, its content, and its pictures by name; nothing if there is none."""
    if panel_file is not None:
        if not panel_file.exists():
            return "", None, {}
        panel = panel_from_file(panel_file).panel
        pictures = {name: (panel_file.parent / name).read_bytes() for name in panel.pictures}
        return str(panel_file), yaml.safe_load(panel_file.read_bytes()), pictures
    attachments = source.flight.attachments if isinstance(source, FlightSource) else {}
    if PANEL_FILE in attachments:
        panel = panel_from_attachments(attachments, flight=source.name).panel
        pictures = {name: attachments[name] for name in panel.pictures if name in attachments}
        return f"{PANEL_FILE} in {source.name}", yaml.safe_load(attachments[PANEL_FILE]), pictures
    return "", None, {}


def _camera(source: PictureSource) -> Camera | None:
    """The camera's calibration that a flight carries."""
    attachments = source.flight.attachments if isinstance(source, FlightSource) else {}
    return parse_camera(attachments[CAMERA_FILE]) if CAMERA_FILE in attachments else None


def _empty(source: PictureSource) -> dict[str, Any]:
    """A panel on the first picture of the sample, with nothing drawn yet."""
    first = source.sample[0]
    source.encoded(first)
    focal_length_mm = source.focal_length_mm(first)
    zoom = {} if focal_length_mm is None else {"focal_length_mm": focal_length_mm}
    return {"name": source.name.rsplit(".", 1)[0], "picture": "panel.jpg", **zoom, "anchors": [], "gauges": []}
