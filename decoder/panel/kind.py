"""The protocol by which a kind of instrument is described in `panel.yaml`, drawn, and set up in the browser.

The one by which it is learned and read is in `decoder.instruments.kind`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol

from decoder.panel.scale import Marks, Quantity

Polar = tuple[float, float]
"""A place on a dial: its angle in degrees, and its distance from the centre in pixels."""

Drawn = dict[str, Any]
"""A part of a draft, in the words of `panel.yaml`, however wrong it still is."""


class Dial(Protocol):
    """What a kind needs of its gauge, as `decoder.panel.gauge.Gauge`."""

    name: str
    radius: tuple[float, float]
    sweep: tuple[float, float]
    tail: bool
    unit: str
    scale: Marks
    wraps: float | None
    centre: tuple[float, float]

    @property
    def window(self) -> tuple[tuple[float, float], ...] | None: ...  # noqa: D102 - said there
    @property
    def reach(self) -> tuple[float, float]: ...  # noqa: D102
    @property
    def beyond_deg(self) -> float: ...  # noqa: D102
    @property
    def is_round(self) -> bool: ...  # noqa: D102


@dataclass(frozen=True, slots=True)
class Pointer:
    """How a quantity is drawn: a line at the angle that is read, or a fixed one at an index.

    `at_deg` is where it lies in the panel picture, if the panel says so; `hides_deg` is the width of what it hides
    there.
    """

    name: str
    at_deg: float | None
    is_fixed: bool
    hides_deg: float | None = None


Reads = Literal["text", "optional_text", "number", "optional", "pairs", "place", "places", "points", "check"]
"""A `place` is one number, or x and y; each of `places` is followed by a value; each of `points` is x, y and value."""


@dataclass(frozen=True, slots=True)
class Control:
    """One value to be typed on the set-up page: its key, its label, and its placeholder."""

    key: str
    label: str
    reads: Reads = "text"
    """What it is."""
    placeholder: str = ""
    options: tuple[str, ...] = ()
    """What there is to choose from, if there are only these."""
    is_angle: bool = False
    """Whether it is an angle on the dial, which turns along when the dial is drawn anew."""
    upright: str = ""
    """For pairs of pixels above the centre and value: the key that says how far their upright turns with the scale."""
    is_of_moment: bool = False
    """Whether it says how the instrument stood in the panel picture, and must be typed again for another picture."""


@dataclass(frozen=True, slots=True)
class Usual:
    """A common instrument: what the set-up page fills in when it is chosen.

    Attributes
    ----------
    name, unit
        Of the gauge.
    columns
        Of its values: one per needle, the finest first, or the names among the fields of its kind.
    turn
        The value of a full turn of it, or of the finest of several needles.
    together
        The column of the value that several needles show together; a turn of each is ten times that of the finer one.
    both_ends
        Whether both ends of its needle point to marks, like a turn coordinator's wings.
    """

    name: str
    unit: str
    columns: tuple[str, ...]
    turn: float | None = None
    together: str = ""
    both_ends: bool = False


@dataclass(frozen=True, slots=True)
class Form:
    """How a kind is drawn on the set-up page.

    Attributes
    ----------
    key
        Of the gauge in `panel.yaml`.
    said
        Its name within a sentence.
    words
        Its name in the list of choices.
    lacking
        What is still missing while nothing of it is drawn.
    along
        Other keys of a gauge that only this kind has.
    begun
        Its initial content besides a name; None if it starts with none of several.
    controls
        Its fields; none if it has its own editor.
    hint
        What else the user has to do.
    turning
        The key that says between which radii the whole dial turns: its `radius`, or the `ring` around its `window`.
    usual
        Common instruments of this kind.
    """

    key: str
    said: str
    words: str
    lacking: str
    along: tuple[str, ...] = ()
    begun: Mapping[str, float | str] | None = None
    controls: tuple[Control, ...] = ()
    hint: str = ""
    turning: Literal["", "radius", "ring"] = ""
    usual: tuple[Usual, ...] = ()


class DescribedKind(Protocol):
    """What the description of one instrument of a kind provides."""

    form: ClassVar[Form]

    in_window: ClassVar[bool]
    """Whether it is read in a `window`, and not on a dial."""

    margin_part: ClassVar[float]
    """How much around its window it needs to see, as a part of the window's shorter side."""

    has_still_face: ClassVar[bool]
    """Whether its dial's marks stay where they are, so that the dial can be found by them."""

    @property
    def brightens(self) -> bool | None:
        """Whether a change makes it brighter than in the panel picture (True) or darker; None if it may do either."""
        ...

    def check(self, dial: Dial) -> None:
        """Raise ValueError if it does not fit its dial."""
        ...

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return what it shows, in the order of the flight data's columns."""
        ...

    def pointers(self) -> tuple[Pointer, ...]:
        """Return what is drawn of it."""
        ...

    def lines(self, dial: Dial, values: Mapping[str, float]) -> Mapping[str, tuple[Polar, Polar] | None]:
        """Return, by quantity, both ends of the line that shows its value, unless a pointer's line does.

        None means that there is such a line, but its place is unknown.

        Parameters
        ----------
        dial
            On which it is.
        values
            By quantity, NaN where there is none.
        """
        ...

    def unwrapped_deg(self, dial: Dial) -> tuple[float, float]:
        """Return the first and the last angle that are unwrapped."""
        ...

    def pictures(self) -> Mapping[str, str]:
        """Return the pictures that it needs besides the panel picture, by their paths below the gauge."""
        ...

    def at_angles(self, true_deg: Callable[[float], float]) -> Mapping[str, object]:
        """Return the content of its keys in a gauge, with every drawn angle replaced by the true one."""
        ...

    def squared_up(
        self, dial: Dial, true_deg: Callable[[float], float], true_size: Callable[[float], float]
    ) -> Mapping[str, object]:
        """Return the content of its keys on a dial that is seen obliquely, as it is square on.

        Parameters
        ----------
        dial
            On which it is drawn as it appears.
        true_deg
            The true angle of one that is drawn.
        true_size
            How long a length of 1 is on the dial that is drawn at an angle.
        """
        ...

    @staticmethod
    def carry(gauge: Drawn, turn_deg: float, size: float, angles_deg: Mapping[str, float]) -> float:
        """Turn and scale its part of a draft along with its dial, onto another picture.

        Parameters
        ----------
        gauge
            Of the draft; modified.
        turn_deg
            How far the dial is turned there.
        size
            The scale factor; the gauge's radius is already scaled.
        angles_deg
            By name, the angle read in the other picture, in the draft's own angles.

        Returns
        -------
        By how much more than the dial its scale is turned in the other picture.
        """
        ...


class Plain:
    """Defaults for kinds on a dial that is unwrapped as a whole, with nothing else to draw or carry."""

    __slots__ = ()
    in_window: ClassVar[bool] = False
    margin_part: ClassVar[float] = 0.0
    has_still_face: ClassVar[bool] = False

    @property
    def brightens(self) -> bool | None:
        """Return None."""
        return None

    def pointers(self) -> tuple[Pointer, ...]:
        """Return none."""
        return ()

    def lines(self, _dial: Dial, _values: Mapping[str, float]) -> Mapping[str, tuple[Polar, Polar] | None]:
        """Return none: pointers show all."""
        return {}

    def unwrapped_deg(self, dial: Dial) -> tuple[float, float]:
        """Return all of it."""
        return dial.sweep

    def pictures(self) -> Mapping[str, str]:
        """Return none: what it looks like is in the panel picture."""
        return {}

    def at_angles(self, _true_deg: Callable[[float], float]) -> Mapping[str, object]:
        """Return nothing."""
        return {}

    def squared_up(
        self, _dial: Dial, true_deg: Callable[[float], float], _true_size: Callable[[float], float]
    ) -> Mapping[str, object]:
        """Return it with true angles: it measures no lengths."""
        return self.at_angles(true_deg)

    @staticmethod
    def carry(_gauge: Drawn, _turn_deg: float, _size: float, _angles_deg: Mapping[str, float]) -> float:
        """Carry nothing: all its places are points, which are carried for every kind."""
        return 0.0


class Windowed(Plain):
    """The same for kinds that are read in a window."""

    __slots__ = ()
    in_window: ClassVar[bool] = True
