"""Tables of the keys of a description: what each is, whether it must be there, and what the string below it says.

A key's description is the string that stands below its field in the source, as PEP 257 has it for attributes; a field
without one is an error, so that nobody forgets it.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

Schema = Mapping[str, Any]
BOUNDS = (("minimum", ">="), ("exclusiveMinimum", ">"), ("maximum", "<="), ("exclusiveMaximum", "<"))
WORDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}


class UndescribedError(Exception):
    """A field has no string below it."""

    def __init__(self, model: str, field: str) -> None:
        super().__init__(f"{model}.{field}: write below it what it is for; docs/reference is made of that.")


def field_sections(outermost: type[BaseModel]) -> str:
    """A section with a table for a model and for each model that it is made of."""
    schema = outermost.model_json_schema()
    parts: Mapping[str, Schema] = schema.get("$defs", {})
    models = {model.__name__: model for model in _models(outermost)}
    return "\n\n".join(
        f"## {name}\n\n{_first_paragraph(models[name])}\n\n{_table(models[name], part)}"
        for name, part in ((outermost.__name__, schema), *parts.items())
    )


def described(model: type[BaseModel]) -> dict[str, str]:
    """The strings below a model's fields and those that it inherits, each as one line, by name."""
    bases = [base for base in model.__mro__ if issubclass(base, BaseModel) and base is not BaseModel]
    return {name: text for base in reversed(bases) for name, text in _own(base).items()}


def _own(model: type[BaseModel]) -> dict[str, str]:
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(model))).body
    if not isinstance(tree, ast.ClassDef):
        raise TypeError(model)
    found = {}
    for field, below in zip(tree.body, tree.body[1:], strict=False):
        match field, below:
            case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(text))):
                found[name] = " ".join(text.split())
    return found


def kind(schema: Schema) -> str:
    """What may stand there, in a few words: `[x, y]`, `number > 0`, or a link to the section that says it."""
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
        return f"[{name}](#{name.lower()})"
    for either in ("anyOf", "oneOf"):
        if either in schema:
            kinds = (kind(option) for option in schema[either] if option.get("type") != "null")
            return " or ".join(dict.fromkeys(kinds))
    if "const" in schema or "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema.get("enum", [schema.get("const")]))
    if "prefixItems" in schema:
        return "[" + ", ".join(kind(item) for item in schema["prefixItems"]) + "]"
    if schema.get("type") == "array":
        return f"[{kind(schema['items'])}, ...]"
    bounds = [f"{sign} {schema[word]:g}" for word, sign in BOUNDS if word in schema]
    return " ".join([_word(schema), " and ".join(bounds)]).strip()


def _word(schema: Schema) -> str:
    if schema.get("type") == "object":
        return f"{{name: {kind(schema['additionalProperties'])}, ...}}"
    return "path" if schema.get("format") == "path" else WORDS[schema.get("type", "string")]


def _table(model: type[BaseModel], schema: Schema) -> str:
    said, needed = described(model), schema.get("required", ())
    rows = ["| key | what it is | if left out | |", "| --- | --- | --- | --- |"]
    for name, field in schema["properties"].items():
        if name not in said:
            raise UndescribedError(model.__name__, name)
        left_out = "must be there" if name in needed else _default(field.get("default"))
        rows.append(f"| `{name}` | {kind(field)} | {left_out} | {said[name]} |")
    return "\n".join(rows)


def _default(value: object) -> str:
    if value in (None, [], "") or isinstance(value, dict):
        return ""
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else f"{value}"


def _first_paragraph(model: type[BaseModel]) -> str:
    return " ".join((inspect.getdoc(model) or "").split("\n\n", 1)[0].split())


def _models(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """A model and all that it is made of."""
    yield model
    for field in model.model_fields.values():
        for part in _parts(field.annotation):
            yield from _models(part)


def _parts(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in getattr(annotation, "__args__", ()):
        yield from _parts(inner)
