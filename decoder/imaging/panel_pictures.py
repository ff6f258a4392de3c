"""A panel with its pictures, loaded from a folder or from the attachments of a flight file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path, PurePosixPath

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.alignment import Alignment
from decoder.imaging.dial_plane import dial_plane, inches_to_picture
from decoder.imaging.optics import Optics
from decoder.imaging.pictures import ColourPicture, GreyPicture, Mixed, colour_picture, grey_picture, without_colour
from decoder.imaging.planes import DialPlane, Raised, Squeeze
from decoder.imaging.resampling import inside, part_inside
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import Grid, PolarGrid, grid_of
from decoder.panel.arrays import Floats
from decoder.panel.camera import Camera
from decoder.panel.errors import PanelError, PictureError
from decoder.panel.gauge import Gauge
from decoder.panel.panel import Panel, parse_panel
from decoder.panel.vocabulary import PANEL_FILE
from flight_file.untrusted import read_named_in, read_yaml_file


@dataclass(frozen=True, slots=True)
class PanelPictures:
    """A panel and all pictures it names, grey, by name; `sha256` is of `panel.yaml` itself.

    Attributes
    ----------
    camera
        That took the pictures, if known.
    planes
        Of the dials, in the panel's order, if better known than from the panel alone.
    squeezes
        As which a flight shows the dials beyond what the panel says, in the same order; none if it shows none.
    encoded
        The pictures as in their files; without them there are no colours.
    mixtures
        The grey in which each gauge is read, in the panel's order; None for luma.
    blur_px
        How much less sharp frames are than the panel picture: the sigma of a Gaussian; 0 if they are not.
    blurred
        The panel picture blurred to the sharpness of frames; None if it is not sharper than they are.
    places
        Where the panel lies in its other pictures, by name, as far as it was found there.
    """

    panel: Panel
    pictures: Mapping[str, GreyPicture]
    sha256: str
    camera: Camera | None = None
    planes: tuple[DialPlane | None, ...] | None = None
    squeezes: tuple[Squeeze | None, ...] = ()
    encoded: Mapping[str, bytes] = field(default_factory=dict)
    mixtures: tuple[Mixed | None, ...] = ()
    blur_px: float = 0.0
    blurred: GreyPicture | None = None
    places: Mapping[str, Alignment] = field(default_factory=dict)

    @property
    def has_colour(self) -> bool:
        """Whether any gauge is read in something other than luma."""
        return any(self.mixtures)

    def in_colour(self, name: str) -> ColourPicture:
        """(H, W, 3) uint8, red, green, blue: one of its pictures."""
        return colour_picture(self.encoded[name]) if name in self.encoded else without_colour(self.pictures[name])

    @property
    def dials(self) -> GreyPicture:
        """(H, W) uint8: the panel picture, as sharp as frames."""
        return self.picture if self.blurred is None else self.blurred

    def dials_in_colour(self) -> ColourPicture:
        """(H, W, 3) uint8, red, green, blue: the panel picture, as sharp as frames."""
        colours = self.in_colour(self.panel.picture)
        return colours if self.blurred is None else _blurred(colours, self.blur_px)

    def as_sharp_as_frames(self, blur_px: float) -> PanelPictures:
        """Return the same pictures, with dials blurred by a Gaussian of this sigma."""
        return replace(self, blur_px=blur_px, blurred=_blurred(self.picture, blur_px))

    @property
    def shortcoming(self) -> str | None:
        """What is wrong with the panel picture for this flight, in a sentence."""
        if self.blurred is None:
            return None
        return (
            f"the panel picture is sharper than the flight, which is blurred by {self.blur_px:.1f} px more: dials were"
            " blurred as much to read them; better draw the panel on a frame of the flight"
        )

    @property
    def picture(self) -> GreyPicture:
        """The panel picture, (H, W) uint8."""
        return self.pictures[self.panel.picture]

    @property
    def optics(self) -> Optics:
        """How the panel picture and frames were taken."""
        height, width = self.picture.shape
        return Optics((width, height), self.panel.focal_length_mm, self.camera)

    def with_planes(self) -> PanelPictures:
        """Compute the planes of its dials.

        Raises
        ------
        PanelError
            If reference points or a rim determine no plane.
        CameraError
            If the camera's calibration does not cover the panel picture.
        """
        if self.planes is not None:
            return self
        return replace(self, planes=tuple(self.plane_of(index, gauge) for index, gauge in enumerate(self.panel.gauges)))

    def plane_of(self, index: int, gauge: Gauge) -> DialPlane | None:
        """Compute the plane of the dial with this index, if it is drawn like this gauge; raises as `with_planes`."""
        optics = self.optics
        inches = inches_to_picture(self.panel.reference_points, self.panel.level, optics)
        plane = dial_plane(gauge, f"gauges[{index}]", optics, inches)
        squeeze = self.squeezes[index] if self.squeezes else None
        return plane if squeeze is None else (plane or DialPlane.square_on(gauge.centre)).squeezed(squeeze)

    def grid(self, index: int) -> Grid:
        """Lay out the sample points of the gauge with this index in the panel."""
        planes, gauge = self.with_planes().planes, self.panel.gauges[index]
        grid = grid_of(gauge, None if planes is None else planes[index])
        if self.mixtures:
            grid = replace(grid, mixture=self.mixtures[index])
        if isinstance(grid, PolarGrid) and gauge.needle_height_inches:
            return replace(grid, raised=self._raised(index))
        return grid

    def check_shows(self, rim: Floats, path: str) -> None:
        """Raise PanelError unless the panel picture shows all that lies within a rim, as from `PolarGrid.rim`."""
        height, width = self.picture.shape
        if not inside(rim, self.optics.own, width, height):
            raise PanelError(path, f"lies outside the {width} x {height} picture; check where it is drawn")

    def check_shows_half(self, rim: Floats, path: str) -> None:
        """Raise PanelError unless the panel picture shows half of a dial's rim, as from `PolarGrid.rim`."""
        height, width = self.picture.shape
        if part_inside(rim, self.optics.own, width, height) < HALF:
            raise PanelError(
                path,
                f"lies outside the {width} x {height} picture for more than half; check where it is drawn",
            )

    def _raised(self, index: int) -> Raised:
        """Find the plane in which a gauge's needles turn, above its face."""
        optics = self.optics
        inches = inches_to_picture(self.panel.reference_points, self.panel.level, optics)
        lacking = {
            "four `reference_points`": inches is None,
            "`focal_length_mm`": optics.focal_length_mm is None,
            "a camera.yaml": optics.camera is None,
        }
        if inches is None or optics.lens is None:
            missing = " and ".join(what for what, is_lacking in lacking.items() if is_lacking)
            raise PanelError(
                f"gauges[{index}].needle_height_inches", f"tells nothing without the camera's position: give {missing}"
            )
        height_inches = self.panel.gauges[index].needle_height_inches
        return Raised(height_inches, tuple((inches / inches[2, 2]).ravel().tolist()))


def _blurred(picture: NDArray[np.uint8], sigma_px: float) -> NDArray[np.uint8]:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma_px), np.uint8)


def panel_from_file(path: Path) -> PanelPictures:
    """Read the panel in a file, with its pictures beside it, or beside the target if it is a link.

    Raises
    ------
    PanelError
        If a file cannot be read or is wrong, naming it and the path of the wrong value.
    """

    def read(name: str) -> bytes:
        return read_named_in(path, name)

    try:
        text = read_yaml_file(path)
    except OSError as error:
        raise PanelError("", f"cannot be read: {error.strerror}", source=str(path)) from error
    return _load(text, read, str(path))


def panel_from_attachments(
    attachments: Mapping[str, bytes], *, flight: str, why_lost: Callable[[str], str] = lambda _name: ""
) -> PanelPictures:
    """Read the panel in a flight file.

    Parameters
    ----------
    why_lost
        Says why an attachment is not there, empty if the flight never carried it; see `Flight.why_lost`.

    Raises
    ------
    PanelError
        If it or one of its pictures is wrong.
    """

    def read(name: str) -> bytes:
        plain = str(PurePosixPath(name))
        if plain not in attachments:
            raise FileNotFoundError(0, why_lost(plain) or "the flight file does not carry it")
        return attachments[plain]

    return _load(attachments[PANEL_FILE], read, f"{PANEL_FILE} in {flight}")


def _load(text: bytes, read: Callable[[str], bytes], source: str) -> PanelPictures:
    panel = parse_panel(text, source=source)
    pictures: dict[str, GreyPicture] = {}
    encoded: dict[str, bytes] = {}
    for name in panel.pictures:
        wanted = (path for gauge in panel.gauges for path, own in gauge.pictures.items() if own == name)
        key = "picture" if name == panel.picture else next(wanted)
        try:
            encoded[name] = read(name)
            pictures[name] = grey_picture(encoded[name])
        except OSError as error:
            raise PanelError(key, f"{name} cannot be read: {error.strerror}", source=source) from error
        except PictureError as error:
            raise PanelError(key, f"{name}: {error}", source=source) from error
    return PanelPictures(panel, pictures, sha256(text).hexdigest(), encoded=encoded)
