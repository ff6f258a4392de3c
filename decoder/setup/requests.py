"""What the page may ask, checked once at the edge."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field, ValidationError
from starlette.requests import Request

from decoder.description import Number, Point, Positive, Strict
from decoder.errors import DecoderError
from decoder.setup.proposals import Dial

PictureKey = Annotated[str, Field(pattern=r"^(panel|frame-\d{1,9})$")]
Tab = Annotated[str, Field(max_length=64)]
Document = dict[str, Any]
MAX_RADIUS_PX = 4000.0


class NotUnderstood(DecoderError):
    """A request's body is not what the page sends."""


class DialQuestion(Strict):
    """A dial, as far as it is drawn."""

    picture: PictureKey
    centre: Point
    radius: tuple[Positive, Annotated[float, Field(gt=0, le=MAX_RADIUS_PX)]]
    sweep: tuple[Number, Number]

    @property
    def dial(self) -> Dial:
        """The dial itself; a sweep beyond a turn is cut, so that a drag gone too far is still answered."""
        inner, outer = self.radius
        first, last = self.sweep
        return Dial(self.centre, (min(inner, outer - 2.0) if outer > 3.0 else 0.5, max(outer, 3.0)),  # noqa: PLR2004
                    (first, min(max(last, first + 5.0), first + 360.0)))  # fmt: skip


class RimQuestion(Strict):
    """Three clicks on a rim."""

    picture: PictureKey
    points: Annotated[tuple[Point, ...], Field(min_length=3, max_length=3)]


class MarkQuestion(Strict):
    """A click on a tick mark."""

    picture: PictureKey
    centre: Point
    click: Point


class NeedlesQuestion(DialQuestion):
    """Where needles are: at an angle that was pointed at, or wherever something moves."""

    document: Document
    near: Number | None = None
    tab: Tab


class DraftQuestion(Strict):
    """A draft on a picture."""

    document: Document
    picture: PictureKey


class TrialQuestion(DraftQuestion):
    """A gauge of a draft to be tried."""

    gauge: Annotated[int, Field(ge=0, le=1000)]
    tab: Tab


class PasteQuestion(DraftQuestion):
    """A draft to be carried to another picture."""

    to: PictureKey


class SaveQuestion(DraftQuestion):
    """A draft to be saved, and the revision that it is based on; `over` saves over what others saved."""

    revision: int
    over: Literal[True] | None = None


Question = TypeVar("Question", bound=Strict)


async def question(request: Request, model: type[Question]) -> Question:
    """The body of a request.

    Raises
    ------
    NotUnderstood
        In one sentence.
    """
    body = await request.body()
    try:
        return model.model_validate(json.loads(body))
    except (ValueError, RecursionError) as error:
        if isinstance(error, ValidationError):
            first = error.errors(include_url=False)[0]
            where = ".".join(str(part) for part in first["loc"])
            raise NotUnderstood(f"the request was not understood: {where}: {first['msg'].lower()}") from error
        raise NotUnderstood("the request was not understood: it is not JSON") from error
