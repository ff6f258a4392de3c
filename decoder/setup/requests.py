"""The requests that the page may make, validated once at the edge."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import Field, TypeAdapter, ValidationError, model_validator
from starlette.requests import Request

from decoder.imaging.planes import DialPlane
from decoder.panel.arrays import Degrees, Number, at_most
from decoder.panel.description import Point, Positive, Strict, sentences_of
from decoder.panel.errors import DecoderError
from decoder.setup.proposals import Dial
from flight_file.thresholds import MAX_YAML_DEPTH
from flight_file.untrusted import printable

PictureKey = Annotated[str, Field(pattern=r"^(panel|frame-\d{1,9})$")]
Tab = Annotated[str, Field(max_length=64)]
Document = dict[str, Any]
RadiusPx = Annotated[Positive, at_most(4000.0)]


class NotUnderstood(DecoderError):
    """A request's body is not what the page sends."""


class SeenQuestion(Strict):
    """A question about a picture, with what the draft tells of how dials are seen there, complete or not."""

    picture: PictureKey
    focal_length_mm: Any = None
    reference_points: Any = None
    level: Any = None

    @property
    def seen(self) -> Document:
        """What the draft tells."""
        return {
            "focal_length_mm": self.focal_length_mm, "reference_points": self.reference_points, "level": self.level,
        }  # fmt: skip


class DialQuestion(SeenQuestion):
    """A dial, as far as it is drawn."""

    centre: Point
    rim: Any = None
    radius: tuple[Positive, RadiusPx]
    sweep: tuple[Degrees, Degrees]

    def dial(self, plane: DialPlane) -> Dial:
        """Make the dial; a sweep beyond a turn is clipped, so that a drag that went too far is still answered."""
        inner, outer = self.radius
        first, last = self.sweep
        return Dial(self.centre, (min(inner, outer - 2.0) if outer > 3.0 else 0.5, max(outer, 3.0)),  # noqa: PLR2004
                    (first, min(max(last, first + 5.0), first + 360.0)), plane)  # fmt: skip


class UnwrapQuestion(DialQuestion):
    """A dial that is being drawn in a tab."""

    tab: Tab


class DrawnRing(Strict):
    """The existing rim of a gauge."""

    centre: Point
    radius: Annotated[RadiusPx, Field(gt=1)]
    rim: Any = None


class RimQuestion(SeenQuestion):
    """Three clicks on a rim, with its hub if needed; or any number of clicks that adjust the `ring` already drawn."""

    points: Annotated[tuple[Point, ...], Field(min_length=1, max_length=60)]
    ring: DrawnRing | None = None

    @model_validator(mode="after")
    def _three_begin_one(self) -> Self:
        if self.ring is None and len(self.points) not in {3, 4}:
            raise ValueError("a new rim takes three points, and its hub if they leave that in doubt")
        return self


class PlaneQuestion(SeenQuestion):
    """Dials whose planes the page wants to draw on."""

    dials: Annotated[tuple[DrawnRing, ...], Field(max_length=200)]


class MarkQuestion(SeenQuestion):
    """A click on a tick mark."""

    centre: Point
    rim: Any = None
    click: Point


class NeedlesQuestion(DialQuestion):
    """Where needles are: at an angle that was pointed at, or wherever something moves."""

    document: Document
    near: Degrees | None = None
    needle_height_inches: Any = None
    tab: Tab


class TurningQuestion(DialQuestion):
    """Between which radii a whole dial turns."""

    document: Document
    tab: Tab


class DraftQuestion(Strict):
    """A draft on a picture; `drawn` is the same with the marks that have no value yet."""

    document: Document
    picture: PictureKey
    drawn: Document | None = None


class TrialQuestion(DraftQuestion):
    """A gauge of a draft to be tried."""

    gauge: Annotated[int, Field(ge=0, le=1000)]
    tab: Tab


class FoundQuestion(DraftQuestion):
    """What can be proposed on a picture in addition to a draft."""

    tab: Tab


class PasteQuestion(DraftQuestion):
    """A draft to be carried to another picture."""

    to: PictureKey


class SaveQuestion(DraftQuestion):
    """A draft to be saved, and the revision that it is based on.

    `over` overwrites what others saved of this panel, `replace` overwrites files that never belonged to it.
    """

    revision: int
    over: Literal[True] | None = None
    replace: Literal[True] | None = None


_DRAWABLE: TypeAdapter[float] = TypeAdapter(Number)
Question = TypeVar("Question", bound=Strict)


async def question(request: Request, model: type[Question]) -> Question:
    """Parse the body of a request.

    Raises
    ------
    NotUnderstood
        In one sentence.
    """
    body = await request.body()
    try:
        content = json.loads(body, parse_constant=_number, parse_int=_whole, parse_float=_number)
        return model.model_validate(_plain(content))
    except ValidationError as error:
        path, problem = sentences_of(error, model, thing="request")[0]
        raise NotUnderstood(f"the request was not understood: {path}: {printable(problem)}") from error
    except (ValueError, RecursionError) as error:
        raise NotUnderstood("the request was not understood: it is not JSON, or not such as the page sends") from error


def _number(text: str) -> float:
    return _DRAWABLE.validate_python(float(text))


def _whole(text: str) -> int:
    return int(_number(text))


def _plain(content: object) -> object:
    """Check that a content's texts can be encoded and that it is not nested too deeply."""
    waiting = [(content, 0)]
    while waiting:
        node, depth = waiting.pop()
        if isinstance(node, str):
            node.encode()  # a lone surrogate is not text
        elif isinstance(node, dict | list):
            if depth == MAX_YAML_DEPTH:
                raise ValueError("nested too deep")
            parts = [*node, *node.values()] if isinstance(node, dict) else node
            waiting += [(each, depth + 1) for each in parts]
    return content
