"""Building blocks of settings, a driver's and others: a block with known keys, and types of values.

The string below a key says what it is for; docs/reference/recorder.yaml.md is made of these strings.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, model_validator

MAX_URL_CHARACTERS = 2000
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]")  # not allowed in names and in sentences of the log


class WithheldError(ValueError):
    """A value is wrong that no sentence is to repeat."""


class Settings(BaseModel):
    """A block of settings, as recorder.yaml has them; a key that it does not have is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _truth_is_no_number(cls, document: object) -> object:
        """Refuse true and false where they would pass for 1 and 0."""
        given = document if isinstance(document, dict) else {}
        for key, field in cls.model_fields.items():
            if isinstance(given.get(key), bool) and field.annotation is not bool:
                raise ValueError(f"{key} is true or false, where another value is wanted")
        return document


def one_line(text: str) -> str:
    """Refuse control characters, among them line ends, by ValueError."""
    if _CONTROL.search(text):
        raise ValueError("it holds a control character")
    return text


def _anchored(path: Path, info: ValidationInfo) -> Path:
    if info.context is None:
        return path  # of a command line, not of a file
    one_line(str(path))
    if path.parts[:1] == ("~",):
        raise ValueError("~ is no home here; write the whole path")
    base = info.context["base"]
    return path if base is None else base / path


AnchoredPath = Annotated[Path, AfterValidator(_anchored)]
Seconds = Annotated[float, Field(gt=0, le=3600)]
Words = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(one_line)]
Size = tuple[Annotated[int, Field(gt=0, le=32_766)], Annotated[int, Field(gt=0, le=32_766)]]
Rate = Annotated[float, Field(ge=0.1, le=240)]
Interval = Annotated[float, Field(ge=0, le=3600)]


class LiveSettings(Settings):
    """What all cameras have that send pictures by themselves."""

    stall_s: Seconds = 10.0
    """Without a picture for so long, the camera is connected again."""
    frozen_s: Seconds = 30.0
    """With the very same picture for so long, the camera is connected again."""
