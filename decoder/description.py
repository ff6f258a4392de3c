"""What people write in YAML, checked once at the edge: the first wrong value becomes one sentence with its path."""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from decoder.errors import DescriptionError

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Point = tuple[Number, Number]


class Strict(BaseModel):
    """A part of a description: unknown keys are errors, nothing changes afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Described = TypeVar("Described", bound=Strict)


def parse_description(
    model: type[Described], text: bytes | str, *, error: type[DescriptionError], thing: str, page: str, source: str
) -> Described:
    """What a YAML text describes.

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
        content: Any = yaml.safe_load(text)
    except (yaml.YAMLError, UnicodeDecodeError) as problem:
        mark = getattr(problem, "problem_mark", None)
        where = f"line {mark.line + 1}" if mark is not None else ""
        raise error(where, f"is not YAML; see {page} for the format", source=source) from problem
    if not isinstance(content, dict):
        raise error("", f"holds no {thing}; see {page} for the format", source=source)
    return check_description(model, content, error=error, thing=thing, source=source)


def check_description(
    model: type[Described], content: object, *, error: type[DescriptionError], thing: str, source: str
) -> Described:
    """What the content of a YAML text describes; see `parse_description`."""
    try:
        return model.model_validate(content)
    except ValidationError as problem:
        raise _first_problem(problem, error, thing, source) from problem


def problems_in(model: type[Strict], content: object, *, thing: str) -> list[tuple[str, str]]:
    """Everything that is wrong with a content: the path of each value and what is wrong with it."""
    try:
        model.model_validate(content)
    except ValidationError as found:
        return [_sentence(problem, thing) for problem in _telling(found)]
    return []


def _first_problem(found: ValidationError, error: type[DescriptionError], thing: str, source: str) -> DescriptionError:
    problems = _telling(found)
    path, message = _sentence(problems[0], thing)
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return error(path, message + more, source=source)


def _telling(found: ValidationError) -> list[ErrorDetails]:
    # A list too short only because its items are wrong is no news.
    problems = [problem for problem in found.errors(include_url=False) if problem["type"] != "too_short"]
    return problems or found.errors(include_url=False)


def _sentence(problem: ErrorDetails, thing: str) -> tuple[str, str]:
    path = ""
    for part in problem["loc"]:
        path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else part
    message = problem["msg"].removeprefix("Value error, ")
    if problem["type"] == "extra_forbidden":
        message = f"is not a key of the {thing} format; remove it or correct its spelling"
    elif problem["type"] == "missing":
        message = "is missing"
    return path, message[0].lower() + message[1:]
