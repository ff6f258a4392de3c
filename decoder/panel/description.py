"""What people write in YAML, validated once at the edge: the first wrong value becomes one sentence with its path."""

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
NAME_PATTERN = r"^[A-Za-z][A-Za-z0-9_]*$"

# What is wrong with a value, by the type of pydantic's error, and with its details.
SAID = {
    "missing": "is missing",
    "float_type": "is not a number",
    "float_parsing": "is not a number",
    "finite_number": "is not a finite number",
    "int_type": "is not a whole number",
    "int_parsing": "is not a whole number",
    "int_parsing_size": "is further from zero than any number here may be",
    "int_from_float": "is not a whole number",
    "bool_type": "is neither true nor false",
    "bool_parsing": "is neither true nor false",
    "string_type": "is not a text; write one, in quotes if it looks like a number",
    "tuple_type": "is not a list, such as [120, 420]",
    "list_type": "is not a list, such as [120, 420]",
    "dict_type": "is not made of keys with their values",
    "mapping_type": "is not made of keys with their values",
    "model_type": "is not made of keys with their values",
    "model_attributes_type": "is not made of keys with their values",
    "too_short": "needs at least {min_length}",
    "too_long": "has more parts than the {max_length} that it may have",
    "string_too_short": "needs {min_length} characters or more",
    "string_too_long": "is longer than {max_length} characters; shorten it",
    "string_pattern_mismatch": "is not written as it must be",
    "literal_error": "is none of what it may be: {expected}",
    "greater_than": "must be more than {gt:g}",
    "greater_than_equal": "must be {ge:g} or more",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be {le:g} or less",
}
SAID_OF_PATTERNS = {NAME_PATTERN: "must begin with a letter, and hold only letters, digits and underscores"}
UNKNOWN = "is not what belongs here"


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
Name = Annotated[Text, Field(pattern=NAME_PATTERN)]
"""Of a column of the flight data."""
PictureName = Annotated[Text, AfterValidator(_beside)]
"""Of a picture that a panel names: where the panel is, so is it."""


class Strict(BaseModel):
    """A part of a description: unknown keys are errors, and it is immutable."""

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
    page : the document that explains its format
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
    """List everything that is wrong with a content: the path of each value and the problem."""
    try:
        model.model_validate(content)
    except ValidationError as found:
        return sentences_of(found, model, thing=thing)
    return []


def sentences_of(found: ValidationError, model: type[Strict], *, thing: str) -> list[tuple[str, str]]:
    """Say what a model found wrong: the path of each value and the problem."""
    return [_sentence(problem, model, thing) for problem in _telling(found)]


def _first_problem(
    found: ValidationError, error: type[DescriptionError], model: type[Strict], thing: str, source: str
) -> DescriptionError:
    problems = _telling(found)
    # A missing key may be present but misspelt.
    beside = [problem for problem in problems if problem["loc"][:-1] == problems[0]["loc"][:-1]]
    first = next((problem for problem in beside if problem["type"] == "extra_forbidden"), problems[0])
    path, message = _sentence(first, model, thing)
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return error(path, message + more, source=source)


def _telling(found: ValidationError) -> list[ErrorDetails]:
    # If a list is too short only because its items are wrong, report just the items.
    problems = [problem for problem in found.errors(include_url=False) if problem["type"] != "too_short"]
    return problems or found.errors(include_url=False)


def _sentence(problem: ErrorDetails, model: type[Strict], thing: str) -> tuple[str, str]:
    path = ""
    for part in problem["loc"]:
        if isinstance(part, str) and part.startswith(("function-", "tuple[")):
            continue  # not a key, but one of several types that a value was tried as
        key = part if isinstance(part, int) else printable(part[:LONGEST_KEY])
        path += f"[{key}]" if isinstance(key, int) else f".{key}" if path else key
    message = _said(problem)
    if problem["type"] == "extra_forbidden":
        (*_, key) = problem["loc"]
        message = _unknown(str(key), _owners(model), thing)
    return path, message


def _said(problem: ErrorDetails) -> str:
    """Say what is wrong in our own words: a library's messages are about its types, not about the text of the file."""
    told = problem.get("ctx", {})
    if problem["type"] == "value_error":
        return str(told["error"])
    if told.get("pattern") in SAID_OF_PATTERNS:
        return SAID_OF_PATTERNS[told["pattern"]]
    return SAID.get(problem["type"], UNKNOWN).format(**told)


def _unknown(key: str, owners: dict[str, list[str]], thing: str) -> str:
    """Say what to do about a key that is unknown in its place."""
    if key in owners:
        return f"is not a key here, but of {' and '.join(owners[key])}: move it there"
    like = get_close_matches(key, owners, 1)
    instead = f"did you mean {like[0]}?" if like else "remove it or correct its spelling"
    return f"is not a key of the {thing} format; {instead}"


@cache
def _owners(model: type[Strict]) -> dict[str, list[str]]:
    """Map the keys of a description and of all its parts, in order, to the parts that have them."""
    schema = model.model_json_schema()
    parts = {model.__name__: schema, **schema.get("$defs", {})}
    owned = [(key, name.lower()) for name, part in parts.items() for key in part.get("properties", {})]
    return {key: [name for own, name in owned if own == key] for key in sorted({key for key, _ in owned})}


class ReferencePoint(Strict):
    """A place on the panel known in inches."""

    at: Point
    """The place in the panel picture."""
    inches: Point
    """The same place on the panel; y may count up or down."""
