"""What people write in YAML, checked once at the edge: the first wrong value becomes one sentence with its path."""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from decoder.panel.arrays import MOST, NO_TRUTH, Number, at_most
from decoder.panel.errors import DescriptionError
from decoder.panel.thresholds import LEAST_VALUE
from flight_file.documents import parse_yaml
from flight_file.errors import NotYamlError
from flight_file.frame import is_focal_length_mm
from flight_file.thresholds import FOCAL_LENGTHS_MM
from flight_file.untrusted import leads_out, printable

LONGEST_TEXT = 200
LONGEST_KEY = 60


def _not_vanishing(number: float) -> float:
    if number < LEAST_VALUE:
        raise ValueError("is smaller than 1e-9; check its digits")
    return number


def _of_a_lens(focal_length_mm: float) -> float:
    if not is_focal_length_mm(focal_length_mm):
        raise ValueError("is no focal length of a lens; give millimetres, {:g} to {:g}".format(*FOCAL_LENGTHS_MM))
    return focal_length_mm


def _one_line(text: str) -> str:
    if not text.isprintable():
        raise ValueError("has a character that is not printable; write it on one line, in plain letters")
    if text[LONGEST_TEXT:]:
        raise ValueError(f"is longer than {LONGEST_TEXT} characters; shorten it")
    return text


def _beside(name: str) -> str:
    if leads_out(name):
        raise ValueError("must be the name of a file in the panel's folder or below, such as panel.jpg")
    return name


Positive = Annotated[float, Field(gt=0, allow_inf_nan=False), NO_TRUTH, at_most(MOST), AfterValidator(_not_vanishing)]
FocalLength = Annotated[float, Field(gt=0, allow_inf_nan=False), NO_TRUTH, AfterValidator(_of_a_lens)]
Pixels = Annotated[Number, at_most(1e5)]
Point = tuple[Pixels, Pixels]
Text = Annotated[str, AfterValidator(_one_line)]
Name = Annotated[Text, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
"""Of a column of the flight data."""
PictureName = Annotated[Text, AfterValidator(_beside)]
"""Of a picture that a panel names: where the panel is, so is it."""


class Strict(BaseModel):
    """A part of a description: unknown keys are errors, nothing changes afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Described = TypeVar("Described", bound=Strict)


def parse_description(
    model: type[Described], text: bytes | str, *, error: type[DescriptionError], thing: str, page: str, source: str
) -> Described:
    """Parse a YAML text as a model.

    Parameters
    ----------
    model : the description's outermost part
    error : raised with the path of the first wrong value
    thing : what the text describes, in a word
    page : the document that says how it is written
    source : the text's name in messages

    Raises
    ------
    DescriptionError
        Of the class `error`.
    """
    try:
        content: Any = parse_yaml(text)
    except NotYamlError as problem:
        raise error(problem.where, f"{problem.problem}; see {page} for the format", source=source) from problem
    if not isinstance(content, dict):
        raise error("", f"holds no {thing}; see {page} for the format", source=source)
    return check_description(model, content, error=error, thing=thing, source=source)


def check_description(
    model: type[Described], content: object, *, error: type[DescriptionError], thing: str, source: str
) -> Described:
    """Check the content of a YAML text against a model; see `parse_description`."""
    try:
        return model.model_validate(content)
    except ValidationError as problem:
        raise _first_problem(problem, error, model, thing, source) from problem


def problems_in(model: type[Strict], content: object, *, thing: str) -> list[tuple[str, str]]:
    """Everything that is wrong with a content: the path of each value and what is wrong with it."""
    try:
        model.model_validate(content)
    except ValidationError as found:
        return [_sentence(problem, model, thing) for problem in _telling(found)]
    return []


def _first_problem(
    found: ValidationError, error: type[DescriptionError], model: type[Strict], thing: str, source: str
) -> DescriptionError:
    problems = _telling(found)
    # A key that is missing may be there, misspelt.
    beside = [problem for problem in problems if problem["loc"][:-1] == problems[0]["loc"][:-1]]
    first = next((problem for problem in beside if problem["type"] == "extra_forbidden"), problems[0])
    path, message = _sentence(first, model, thing)
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return error(path, message + more, source=source)


def _telling(found: ValidationError) -> list[ErrorDetails]:
    # A list too short only because its items are wrong is no news.
    problems = [problem for problem in found.errors(include_url=False) if problem["type"] != "too_short"]
    return problems or found.errors(include_url=False)


def _sentence(problem: ErrorDetails, model: type[Strict], thing: str) -> tuple[str, str]:
    path = ""
    for part in problem["loc"]:
        if isinstance(part, str) and part.startswith(("function-", "tuple[")):
            continue  # not a key, but which of several types a value was tried as
        key = part if isinstance(part, int) else printable(part[:LONGEST_KEY])
        path += f"[{key}]" if isinstance(key, int) else f".{key}" if path else key
    message = problem["msg"].removeprefix("Value error, ")
    if problem["type"] == "extra_forbidden":
        (*_, key) = problem["loc"]
        like = get_close_matches(str(key), _keys(model), 1)
        instead = f"did you mean {like[0]}?" if like else "remove it or correct its spelling"
        message = f"is not a key of the {thing} format; {instead}"
    elif problem["type"] == "missing":
        message = "is missing"
    return path, message[0].lower() + message[1:]


@cache
def _keys(model: type[Strict]) -> list[str]:
    """List the keys of a description and of all its parts."""
    schema = model.model_json_schema()
    parts = [schema, *schema.get("$defs", {}).values()]
    return sorted({key for part in parts for key in part.get("properties", {})})


class ReferencePoint(Strict):
    """A place on the panel known in inches."""

    at: Point
    """The place in the panel picture."""
    inches: Point
    """The same place on the panel; y may count up or down."""
