"""How the house is built: few rooms, each of few modules, and no long chain of imports through them."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import grimp
import pytest

from decoder.panel.gauge import KINDS

pytestmark = pytest.mark.xdist_group("rooms")  # one worker reads all modules

ROOT = Path(__file__).parents[1]
DECODER = ROOT / "decoder"
ROOMS = sorted(path.parent for path in DECODER.glob("*/__init__.py"))
PACKAGES = sorted(
    path.parent for name in ("camera_drivers", "flight_file", "recorder") for path in (ROOT / name).rglob("__init__.py")
)
FRONT_DOOR = {"__init__.py", "start.py"}
MAX_ROOMS, MAX_MODULES, MAX_MODULES_OUTSIDE = 12, 15, 20
MAX_THRESHOLDS, MAX_THRESHOLDS_OUTSIDE = 149, 26
# Of what only proposes to a person, and decides on no reading: a table of its own.
PROPOSES, MAX_THRESHOLDS_PROPOSING = "decoder.setup.finding.thresholds", 34
# Compared, but no choice of ours: units, codes, formats, a JPEG's blocks, where bank scales have marks, unknowns, how
# finely something is divided.
CONVERSIONS = {
    "BESIDES_DEG",
    "COARSE_STEP",
    "DIGITS",
    "DIGITS_OF_FULL_SCALE",
    "FACE",
    "FINEST",
    "FULL_CIRCLE_DEG",
    "HIDDEN",
    "LETTER_WIDTH",
    "MARKS_DEG",
    "MAD_TO_SIGMA",
    "MIN_PAIRS",
    "MIN_POINTS",
    "NS_PER_S",
    "ONE",
    "PHASES_PER_ROW",
    "RADIUS_PX",
    "READ",
    "ROWS_OF_BLOCKS",
    "UNIFORM_SIGMA",
    "WHITE",
}
LIMITING = {"min", "max", "clip", "minimum", "maximum", "limited"}
# The rooms that may name a kind of instrument, and where each kind is written there.
OF_KINDS = {"instruments", "panel"}
KIND_MODULES = {kind.__module__ for kind in KINDS} | {
    f"decoder.instruments.kinds.{path.parent.name}.{path.stem}"
    for path in (DECODER / "instruments" / "kinds").glob("*/*.py")
}
ALCOVES = {
    "commands": {"calibrate"},
    "instruments": {"kinds", "kinds/dials", "kinds/windows"},
    "outputs": {"report"},
    "panel": {"kinds"},
    "setup": {"finding", "proposing"},
}  # a room may have a folder for what there are many of
OF_FLIGHT_DATA = {"self.description['needles']", "content['needles']"}  # flight.json has such a key: all its columns
LONGEST_CHAIN = {"camera_drivers": 13, "decoder": 18, "flight_file": 10, "recorder": 16}


@cache
def _chains() -> dict[str, int]:
    """By module how many modules the longest chain of imports from it has, itself included.

    Raises
    ------
    graphlib.CycleError
        If modules import each other in a circle.
    """
    graph = grimp.build_graph(*LONGEST_CHAIN, cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    lengths: dict[str, int] = {}
    for module in TopologicalSorter(imports).static_order():
        lengths[module] = 1 + max((lengths[below] for below in imports[module]), default=0)
    return lengths


@pytest.mark.parametrize("package", LONGEST_CHAIN)
def test_chains_of_imports_are_short(package: str) -> None:
    """Whoever follows the imports of a module, types and late imports too, soon comes to the ground."""
    own = {module: length for module, length in _chains().items() if module.partition(".")[0] == package}

    furthest = max(own, key=lambda module: own[module])
    assert own[furthest] <= LONGEST_CHAIN[package], f"{furthest} stands on {own[furthest] - 1} others"


def test_only_the_front_door_lies_outside_the_rooms() -> None:
    """Each module of the decoder is in a room."""
    assert {path.name for path in DECODER.glob("*.py")} == FRONT_DOOR


def test_rooms_are_few_and_none_is_crowded() -> None:
    """There are few rooms, and few modules in each, so that one look takes them in."""
    modules = Counter(path.parent for room in ROOMS for path in room.rglob("*.py") if path.name != "__init__.py")

    folders = {room.name: {str(path.parent.relative_to(room)) for path in room.glob("*/**/*.py")} for room in ROOMS}
    assert {room: found for room, found in folders.items() if found} == ALCOVES
    assert len(ROOMS) <= MAX_ROOMS
    assert max(modules.values()) <= MAX_MODULES


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_packages_beside_the_decoder_are_not_crowded(package: Path) -> None:
    """One look takes in the modules of each."""
    assert len([path for path in package.glob("*.py") if path.name != "__init__.py"]) <= MAX_MODULES_OUTSIDE


@pytest.mark.parametrize("room", ROOMS + PACKAGES, ids=lambda room: room.name)
def test_a_room_says_what_it_is_for_and_nothing_else(room: Path) -> None:
    """Three sentences: what lives there, what comes in, what goes out. Modules are imported by their own names."""
    (text,) = ast.parse((room / "__init__.py").read_text(encoding="utf-8")).body

    assert isinstance(text, ast.Expr)
    said = str(ast.literal_eval(text.value)).split()
    assert sum(word.endswith(".") for word in said) == 3
    assert "In come" in " ".join(said)
    assert "Out go" in " ".join(said)


def _numbers(tree: ast.Module) -> Iterator[str]:
    """The names that a module gives to numbers, in capitals."""
    for statement in tree.body:
        match statement:
            case ast.Assign(targets=[target], value=value) | ast.AnnAssign(target=target, value=ast.expr() as value):
                kinds = {type(each.value) for each in ast.walk(value) if isinstance(each, ast.Constant)}
                if kinds & {int, float} and not kinds & {str, bytes}:
                    yield from (
                        each.id for each in ast.walk(target) if isinstance(each, ast.Name) and each.id.isupper()
                    )


def _compared(tree: ast.Module) -> set[str]:
    """The names that a module compares with something, or limits something by."""
    limits = (
        each
        for each in ast.walk(tree)
        if isinstance(each, ast.Compare)
        or (isinstance(each, ast.Call) and ast.unparse(each.func).rpartition(".")[2] in LIMITING)
    )
    return {name.id for each in limits for name in ast.walk(each) if isinstance(name, ast.Name)}


@cache
def _thresholds() -> dict[str, set[str]]:
    """By module the numbers that are compared, there or where they are imported."""
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in DECODER.rglob("*.py")}
    compared = {path: _compared(tree) for path, tree in trees.items()}
    abroad = {
        (each.module, alias.name)
        for path, tree in trees.items()
        for each in ast.walk(tree)
        if isinstance(each, ast.ImportFrom)
        for alias in each.names
        if alias.name in compared[path]
    }
    found = {}
    for path, tree in trees.items():
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        names = {name for name in _numbers(tree) if name in compared[path] or (module, name) in abroad}
        found[module] = names - CONVERSIONS
    return found


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.name)
def test_thresholds_stand_in_one_table(room: Path) -> None:
    """What is compared with something is in the room's thresholds.py, with unit, meaning and source."""
    own = f"decoder.{room.name}."
    scattered = {module: names for module, names in _thresholds().items() if module.startswith(own) and names}
    tables = {f"{own}thresholds", PROPOSES}

    assert set(scattered) <= tables
    for table in room.rglob("thresholds.py"):
        assert _rows(table.parent) == _numbers_of(table.parent)


def _rows(room: Path) -> list[str]:
    """The names in a room's table of thresholds."""
    text = ast.get_docstring(ast.parse((room / "thresholds.py").read_text(encoding="utf-8"))) or ""
    return re.findall(r"^\| (\w+) (?:\| [^|]+ ){4}\|$", text, re.MULTILINE)[1:]


def _numbers_of(room: Path) -> list[str]:
    """The numbers below it."""
    return list(_numbers(ast.parse((room / "thresholds.py").read_text(encoding="utf-8"))))


@pytest.mark.parametrize("package", sorted(set(LONGEST_CHAIN) - {"decoder"}))
def test_thresholds_beside_the_decoder_stand_in_one_table(package: str) -> None:
    """A package of the box has one table, of few rows."""
    assert _rows(ROOT / package) == _numbers_of(ROOT / package)
    assert len(_numbers_of(ROOT / package)) <= MAX_THRESHOLDS_OUTSIDE


def test_thresholds_are_few() -> None:
    """Each is a choice that somebody has to understand."""
    thresholds = _thresholds()

    assert len(thresholds.pop(PROPOSES)) <= MAX_THRESHOLDS_PROPOSING
    assert sum(map(len, thresholds.values())) <= MAX_THRESHOLDS


def test_tests_stand_where_what_they_test_stands() -> None:
    """Each folder of tests of the decoder is named after a room."""
    folders = {path.name for path in (ROOT / "tests" / "decoder").iterdir() if list(path.glob("test_*.py"))}

    assert folders <= {room.name for room in ROOMS}


def _kinds_named(tree: ast.Module) -> Iterator[str]:
    """What a module says of a certain kind: the key it has in `panel.yaml`, or the modules in which it is written."""
    keys = {kind.form.key for kind in KINDS}
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(attr=name) if name in keys:
                yield ast.unparse(node)
            case ast.Subscript(slice=ast.Constant(value=name)) if name in keys:
                yield ast.unparse(node)
            case ast.Call(func=ast.Attribute(attr="get"), args=[ast.Constant(value=name), *_]) if name in keys:
                yield ast.unparse(node)
            case ast.Call(func=ast.Name(id="getattr"), args=[_, ast.Constant(value=name), *_]) if name in keys:
                yield ast.unparse(node)
            case ast.Compare() if keys & {each.value for each in ast.walk(node) if isinstance(each, ast.Constant)}:
                yield ast.unparse(node)
            case ast.ImportFrom(module=str(module)) if module in KIND_MODULES:
                yield ast.unparse(node)
            case ast.Import(names=names) if KIND_MODULES & {alias.name for alias in names}:
                yield ast.unparse(node)


@pytest.mark.parametrize(
    "said",
    [
        "gauge.card is not None",
        "len(own.needles)",
        'gauge["card"]',
        'gauge.get("needles")',
        'getattr(gauge, "card")',
        'key == "needles"',
        "from decoder.panel.kinds.card import Card",
        "import decoder.instruments.kinds.dials.stack",
    ],
)
def test_whoever_asks_for_a_kind_is_seen(said: str) -> None:
    """The next test sees a kind in whatever way it is asked for."""
    assert list(_kinds_named(ast.parse(said)))


@pytest.mark.parametrize("room", [room for room in ROOMS if room.name not in OF_KINDS], ids=lambda room: room.name)
def test_nothing_else_asks_which_kind_of_instrument_it_has_before_it(room: Path) -> None:
    """What differs from kind to kind, the kind says: in the panel what is drawn, in the instruments how it is read."""
    named = {path.name: set(_kinds_named(ast.parse(path.read_text(encoding="utf-8")))) for path in room.glob("*.py")}

    assert {name: said - OF_FLIGHT_DATA for name, said in named.items() if said - OF_FLIGHT_DATA} == {}


def test_the_page_has_an_editor_of_its_own_for_needles_alone() -> None:
    """Every other kind is drawn on the set-up page by the form that it gives."""
    others = {kind.form.key for kind in KINDS if kind.form.controls}
    page = "\n".join(path.read_text(encoding="utf-8") for path in (DECODER / "setup" / "page").glob("*.js"))
    ways = r"""\w\.{0}\b|{{[^}}=]*\b{0}\b[^=]*}}\s*\)?\s*=|(?:==\s*|\[)["']{0}["']"""

    assert others
    assert [key for key in others if re.search(ways.format(key), page)] == []
