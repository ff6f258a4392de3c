"""Print what the box needs of pyproject.toml: what builds the project, and what the box's code imports.

So a dependency is stated once, and the box lacks none and gets none of the desk's, nor what an extra brings; with the
name of an extra, what that brings alone. A module that imports what only an extra brings is loaded only where that is;
what else it imports is not the box's. `make lock` writes requirements.lock from it, and requirements-video.lock.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

ROOT = Path(__file__).parents[1]
BOX = ("camera_drivers", "flight_file", "recorder")


def imported(extras: set[str]) -> dict[str, Path]:
    """Packages of others that the box's code imports anywhere, each with one of the modules that do.

    Parameters
    ----------
    extras
        Distributions that only an extra brings.
    """
    distributions = packages_distributions()
    names: dict[str, Path] = {}
    for path in (path for package in BOX for path in sorted((ROOT / package).rglob("*.py"))):
        found = set(_imports(ast.parse(path.read_bytes()))) - {*sys.stdlib_module_names, *BOX}
        if not any({_distribution(each) for each in distributions.get(name, ())} & extras for name in found):
            names |= dict.fromkeys(found, path)
    return names


def _imports(module: ast.Module) -> Iterator[str]:
    for node in ast.walk(module):
        match node:
            case ast.Import(names=names):
                yield from (alias.name.partition(".")[0] for alias in names)
            case ast.ImportFrom(module=str(name), level=0):
                yield name.partition(".")[0]


def _distribution(requirement: str) -> str:
    return re.sub(r"[-_.]+", "-", re.split(r"[^\w.-]", requirement)[0]).lower()


def requirements() -> list[str]:
    """Those of pyproject.toml's dependencies; ends the program if an import is of none of them."""
    document = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    stated = {_distribution(line): line for line in document["project"]["dependencies"]}
    extras = {_distribution(line) for lines in document["project"]["optional-dependencies"].values() for line in lines}
    distributions = packages_distributions()
    needed = set()
    for name, path in sorted(imported(extras - stated.keys()).items()):
        known = {_distribution(each) for each in distributions.get(name, ())} & stated.keys()
        if not known:
            sys.exit(f"{path.relative_to(ROOT)} imports {name}, which pyproject.toml does not state; state it there.")
        needed |= known
    return sorted([*document["build-system"]["requires"], *(stated[name] for name in needed)])


def extra(name: str) -> list[str]:
    """Those of one extra of pyproject.toml."""
    document = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return list(document["project"]["optional-dependencies"][name])


if __name__ == "__main__":
    print(*(extra(sys.argv[1]) if sys.argv[1:] else requirements()), sep="\n")
