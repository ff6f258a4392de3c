"""One set-up: the flight it is drawn on, the panel that was opened, where it is saved, and which tab may save it."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from decoder.imaging.alignment import Alignment
from decoder.imaging.panel_pictures import panel_from_attachments, panel_from_file
from decoder.imaging.pictures import FramePicture, GreyPicture, colour_picture, grey_picture
from decoder.panel.camera import Camera, parse_camera
from decoder.panel.description import LONGEST_TEXT
from decoder.panel.errors import DecoderError, PanelError, PictureError
from decoder.panel.vocabulary import CAMERA_FILE, PANEL_FILE
from decoder.registration.aligner import Aligner
from decoder.setup.drafts import (
    DEFAULT_PICTURE,
    AlignmentMemory,
    Document,
    Problem,
    RememberedPanel,
    Stale,
    Superseded,
    aligner_of,
    panel_of_gauge,
    problems_of,
)
from decoder.setup.drawn_plane import Planes
from decoder.setup.proposals import Pictures
from decoder.setup.saving import Draft, DraftFile, digest, panel_text, plain_name, save_files
from decoder.setup.sources import PANEL_KEY, FlightSource, PictureSource, PictureStore
from flight_file.documents import parse_yaml
from flight_file.errors import FlightFileError
from flight_file.untrusted import name_key, printable, read_named_in, read_yaml_file

KEPT_ALIGNMENTS = 8
MOST_LISTED = 12
Aligned = list[tuple[GreyPicture, Alignment]]


class SavedElsewhere(DecoderError):
    """Another tab or program has saved the panel since this one opened it."""


class WouldReplace(DecoderError):
    """Files exist where the panel is saved that were neither opened as this panel nor saved by this page."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        super().__init__(
            f"{' and '.join(names)} in {folder} would be replaced, and {'are' if len(names) > 1 else 'is'} not of the"
            " panel that was opened; save over what is there, or start decode setup again with --save-as"
        )


class NotValid(DecoderError):
    """The draft is not a valid panel yet."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = problems
        count = f"{len(problems)} things" if len(problems) > 1 else "1 thing"
        listed = [f"{each.path}: {each.problem}" if each.path else each.problem for each in problems[:MOST_LISTED]]
        more = [f"and {len(problems) - MOST_LISTED} more"] if problems[MOST_LISTED:] else []
        super().__init__(f"{count} to correct before the panel can be saved: {'; '.join([*listed, *more])}")


class SetupSession:
    """What the page's server knows; thread-safe.

    Parameters
    ----------
    source
        The flight or the picture.
    panel_file
        The panel to open; a new one is begun if it does not exist. If None, the flight's own is opened.
    target
        Where the panel is saved, its pictures beside it.
    camera
        That took the pictures; if None, the one in the flight.
    is_new
        Begin a new panel, whatever the flight contains.
    """

    def __init__(
        self,
        source: PictureSource,
        panel_file: Path | None,
        target: Path,
        *,
        camera: Camera | None = None,
        is_new: bool = False,
    ) -> None:
        self.source = source
        # A panel opened through a link is saved through it: its target is what was opened.
        is_opened = panel_file is not None and panel_file.exists() and target.exists() and panel_file.samefile(target)
        self.target = Path(os.path.realpath(target)) if is_opened and target.is_symlink() else target
        self.revision = 0
        self.opened_from, document, self._pictures = ("", None, {}) if is_new else _opened(source, panel_file)
        panel_picture = self._pictures.get(str(document.get("picture"))) if document else None
        self.store = PictureStore(source, panel_picture)
        self.picture_key = PANEL_KEY if panel_picture is not None else f"frame-{source.sample[0]}"
        self.document: dict[str, Any] = document or _empty(source)
        self.camera = camera or _camera(source)
        self._digest = digest(self.target)
        self._own = self._opened_files(panel_file)
        self._draft_file = DraftFile(self.target, source.name)
        self._memory = lru_cache(KEPT_ALIGNMENTS)(lambda _finding: AlignmentMemory())
        self._lock = threading.Lock()

    def pictures(self, document: Document, key: str) -> dict[str, GreyPicture]:
        """Open the grey pictures that a draft names, its panel picture being the one under `key`."""
        named = {name: grey_picture(encoded) for name, encoded in self._template_pictures(document).items()}
        return {**named, str(document.get("picture", "panel.jpg")): self.store.grey(key)}

    def encoded(self, document: Document, key: str) -> dict[str, bytes]:
        """Return the same pictures as they are in their files."""
        return {**self._template_pictures(document), str(document.get("picture", "panel.jpg")): self.store.encoded(key)}

    def problems(self, document: Document, key: str) -> list[Problem]:
        """List what keeps a draft from being saved."""
        pictures, encoded = self.pictures(document, key), self.encoded(document, key)
        found = problems_of(document, pictures, self.camera, encoded)
        try:
            plain_name(str(document.get("picture", "")), "picture", target=self.target.name)
        except PanelError as error:
            found = [*(each for each in found if each.path != error.path), Problem(error.path, error.problem)]
        return found

    @property
    def draft(self) -> Draft | None:
        """What was drawn here before and not saved."""
        draft = self._draft_file.read()
        if draft is None or self._is_saved(draft):
            return None
        try:
            self.store.grey(draft.picture)
        except (DecoderError, FlightFileError):
            return None
        return draft

    def keep(self, document: Document, key: str) -> None:
        """Store a draft until it is saved, in case the program ends."""
        draft = Draft(dict(document), key)
        with self._lock:
            if self._is_saved(draft):
                self._draft_file.drop()
            else:
                self._draft_file.keep(draft)

    def _is_saved(self, draft: Draft) -> bool:
        return (draft.document, draft.picture) == (self.document, self.picture_key)

    def save(self, document: Document, key: str, revision: int, *, replaces: bool = False) -> int:
        """Save a draft; return the number of the new revision.

        Files of the panel that was opened, or saved before, are replaced; others only with `replaces`.

        Raises
        ------
        SavedElsewhere
            If it was saved since the revision that the draft is based on.
        WouldReplace
            If other files exist there, unless `replaces`.
        NotValid
            With everything that is wrong.
        OutputError
            If it cannot be written.
        """
        with self._lock:
            if revision != self.revision or digest(self.target) != self._digest:
                raise SavedElsewhere(
                    "this panel was saved from somewhere else meanwhile; load that one, or save anyway"
                )
            problems = self.problems(document, key)
            if problems:
                raise NotValid(problems)
            files = self._files(document, key)
            if not replaces:
                self._refuse_replacing(files)
            save_files(self.target.parent, files)
            self._digest = digest(self.target)
            self._own |= {name: sha256(content).hexdigest() for name, content in files.items()}
            self.document, self.picture_key = dict(document), key
            self._draft_file.drop()
            self.revision += 1
            return self.revision

    def _opened_files(self, panel_file: Path | None) -> dict[str, str]:
        """Return the SHA-256 of the files that were opened, by name, if the panel is saved where it was opened."""
        if panel_file is None or self._digest is None or not panel_file.samefile(self.target):
            return {}
        pictures = {name: sha256(content).hexdigest() for name, content in self._pictures.items()}
        return {**pictures, self.target.name: self._digest}

    def _files(self, document: Document, key: str) -> dict[str, bytes]:
        """Collect what is saved, by name; `panel.yaml` last."""
        named = {**self._template_pictures(document), str(document["picture"]): self.store.encoded(key)}
        files = {plain_name(name, "picture", target=self.target.name): content for name, content in named.items()}
        if len({name_key(name) for name in files}) < len(files):
            raise PanelError("picture", "is called as a needle's picture is, but for capitals; rename one")
        return {**files, self.target.name: panel_text(document).encode("utf-8")}

    def _refuse_replacing(self, files: Mapping[str, bytes]) -> None:
        folder = self.target.parent
        there = {name: digest(folder / name) for name in files}
        own = {name: (None, self._own.get(name), sha256(content).hexdigest()) for name, content in files.items()}
        strangers = [name for name, found in there.items() if found not in own[name]]
        if strangers:
            raise WouldReplace(folder, strangers)

    def accept_others(self) -> int:
        """Accept what was saved elsewhere, so that it may be overwritten; return the revision to name then."""
        with self._lock:
            before, self._digest = self._digest, digest(self.target)
            if self._digest is not None and self._digest != before:
                self._own[self.target.name] = self._digest
            return self.revision

    def planes(self, document: Document, key: str) -> Planes:
        """Collect what a draft tells of how its dials are seen in the picture under `key`."""
        height, width = self.store.grey(key).shape
        return Planes.of(document, (width, height), self.camera)

    def aligner(self, document: Document, key: str) -> Aligner | None:
        """Make the aligner of a draft, if anchors and level suffice."""
        memory = self._memory(_finding(document, key))
        return aligner_of(document, self.store.grey(key), self.planes(document, key).optics, memory)

    def aligned(self, document: Document, key: str, stale: Stale) -> Aligned:
        """Align the sample's frames that show the panel; without anchors they are taken as they are.

        Raises
        ------
        Superseded
            If the question became stale meanwhile.
        """
        aligner = self.aligner(document, key)
        picture, own = self.store.grey(key), self.planes(document, key).optics.own
        found: Aligned = []
        for _, taken in self.frames():
            if stale():
                raise Superseded
            alignment = _where(aligner, taken, own) if taken.pixels.shape == picture.shape else None
            if alignment is not None:
                found.append((taken.pixels, alignment))
        return found

    def seen(self, document: Document, key: str, stale: Stale) -> Pictures:
        """Collect the picture under `key` and the sample's frames, with the panel's alignment; as `aligned`."""
        own = self.planes(document, key).optics.own
        return Pictures(self.store.grey(key), self.aligned(document, key, stale), own)

    def panel_of_gauge(self, document: Document, key: str, index: int) -> RememberedPanel:
        """Do `drafts.panel_of_gauge`, sharing what the same anchors found in frames before."""
        pictures, encoded = self.pictures(document, key), self.encoded(document, key)
        memory = self._memory(_finding(document, key))
        return panel_of_gauge(document, index, pictures, self.camera, encoded, memory=memory)

    def frames(self) -> list[tuple[int, FramePicture]]:
        """Open the sample's frames that can be decompressed, with their numbers."""
        found = []
        for index in self.source.sample:
            try:
                found.append((index, self.frame(f"frame-{index}")))
            except PictureError:
                continue  # `decode` reports it
        return found

    def frame(self, key: str) -> FramePicture:
        """Open the picture under a key, with its zoom if it is one of the flight's."""
        grey = self.store.grey(key)
        number = key.removeprefix("frame-")
        focal_length_mm = self.source.focal_length_mm(int(number)) if number != key else None
        return FramePicture(grey, focal_length_mm, lambda: colour_picture(self.store.encoded(key)))

    def _template_pictures(self, document: Document) -> Mapping[str, bytes]:
        """Collect the pictures that a draft names besides the panel picture, as far as they exist."""
        return {
            name: self._pictures[name]
            for name in _pictures_in(document.get("gauges"))
            if name in self._pictures and name != document.get("picture")
        }


def _finding(document: Document, key: str) -> str:
    """Return a key of everything that finding the panel in frames depends on."""
    parts = ("anchors", "level", "reference_points", "focal_length_mm")
    return json.dumps([key, *(document.get(part) for part in parts)])


def _pictures_in(part: object) -> Iterator[str]:
    """List the pictures that a part of a draft names, whatever else is wrong with it."""
    if isinstance(part, dict) and isinstance(part.get("picture"), str):
        yield part["picture"]
    for inner in part.values() if isinstance(part, dict) else part if isinstance(part, list) else ():
        yield from _pictures_in(inner)


def _where(aligner: Aligner | None, frame: FramePicture, own: Alignment) -> Alignment | None:
    if aligner is None:
        return own
    try:
        return aligner.align(frame.pixels, frame.focal_length_mm)
    except PictureError:
        return None


def _opened(source: PictureSource, panel_file: Path | None) -> tuple[str, dict[str, Any] | None, dict[str, bytes]]:
    """Return where a panel was opened from, its content, and its pictures by name; empty if there is none."""
    if panel_file is not None:
        if not panel_file.exists():
            return "", None, {}
        panel = panel_from_file(panel_file).panel
        pictures = {name: read_named_in(panel_file, name) for name in panel.pictures}
        return str(panel_file), parse_yaml(read_yaml_file(panel_file)), pictures
    attachments = source.flight.attachments if isinstance(source, FlightSource) else {}
    if PANEL_FILE in attachments and isinstance(source, FlightSource):
        panel = panel_from_attachments(attachments, flight=source.name, why_lost=source.flight.why_lost).panel
        pictures = {name: attachments[name] for name in panel.pictures if name in attachments}
        return f"{PANEL_FILE} in {source.name}", parse_yaml(attachments[PANEL_FILE]), pictures
    return "", None, {}


def _camera(source: PictureSource) -> Camera | None:
    """Parse the camera in a flight."""
    attachments = source.flight.attachments if isinstance(source, FlightSource) else {}
    return parse_camera(attachments[CAMERA_FILE]) if CAMERA_FILE in attachments else None


def _empty(source: PictureSource) -> dict[str, Any]:
    """Begin a panel on the first picture of the sample, with nothing drawn yet."""
    first = source.sample[0]
    source.encoded(first)
    focal_length_mm = source.focal_length_mm(first)
    zoom = {} if focal_length_mm is None else {"focal_length_mm": focal_length_mm}
    name = printable(source.name).rsplit(".", 1)[0][:LONGEST_TEXT]
    return {"name": name, "picture": DEFAULT_PICTURE, **zoom, "anchors": [], "gauges": []}
