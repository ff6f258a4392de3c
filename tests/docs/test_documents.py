"""The documents say what is: links lead somewhere, commands exist, examples are accepted, docs/reference is renewed."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import click
import pytest
import yaml
from pydantic import BaseModel

from camera_drivers.picamera.options import PicameraSettings
from camera_drivers.qx10.options import Qx10Settings
from camera_drivers.qx10.simulator.faults import FAULTS
from camera_drivers.rtsp.options import RtspSettings
from camera_drivers.uvc.options import UvcSettings
from decoder.commands.cli import cli as decode
from decoder.outputs.garmin_output import BY_NAME
from decoder.panel.camera import parse_camera
from decoder.panel.gauge import Gauge
from decoder.panel.panel import parse_panel
from decoder.panel.parameters import Column
from decoder.timeseries.tables import read_mapping
from docs_pages.commands import command_names, command_pages
from docs_pages.reference import pages
from recorder.cli import main as recorder
from recorder.config import parse_config
from tests.docs.samples import FENCE
from tests.programs import ROOT, ran

DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "fixtures" / "README.md",
    *(ROOT / "docs").rglob("*.md"),
]


def blocks(document: Path, language: str = "") -> list[str]:
    """The fenced code blocks of a document in one language."""
    return [
        fence["body"] for fence in FENCE.finditer(document.read_text(encoding="utf-8")) if fence["kind"] == language
    ]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_and_make_commands_lead_somewhere(document: Path) -> None:
    """Every relative link names a file that is there, every `make` command a target."""
    text = document.read_text(encoding="utf-8")
    links = re.findall(r"\]\((?!https?:)([^)#]+)", text)
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))

    assert [link for link in links if not (document.parent / link).exists()] == []
    assert {*re.findall(r"`make ([a-z-]+)`", text), *re.findall(r"^make ([a-z-]+)", text, re.MULTILINE)} <= targets


def test_the_index_leads_to_every_page() -> None:
    """docs/README.md names each document of docs/."""
    docs = ROOT / "docs"
    links = set(re.findall(r"\]\(([^)#:]+)", (docs / "README.md").read_text(encoding="utf-8")))

    assert {str(page.relative_to(docs)) for page in docs.rglob("*.md")} - links == {"README.md"}


def test_panel_examples_are_a_panel_and_gauges() -> None:
    """The panel in docs/panel.md and the single gauges below it are such as the decoder takes."""
    panel, *examples = blocks(ROOT / "docs" / "panel.md", "yaml")

    assert parse_panel(panel).gauges[0].needles[0].covered_by == "fuel_fr_lb"
    assert examples
    for example in map(yaml.safe_load, examples):
        if "columns" in example:
            assert all(Column.model_validate(column) for column in example["columns"].values())
        else:
            assert Gauge.model_validate(example).name


def test_name_mappings_are_such(tmp_path: Path) -> None:
    """The mappings of names in docs/flight-data.md are such as the commands take; the first names G1000 columns."""
    found = []
    for number, example in enumerate(blocks(ROOT / "docs" / "flight-data.md", "yaml")):
        path = tmp_path / f"{number}.yaml"
        path.write_text(example, encoding="utf-8")
        found.append(read_mapping(path))

    assert {mapped.name for mapped in found[0].values()} <= set(BY_NAME)
    assert found[1]["airspeed_kt"].unit == "km/h"


def run_all(lines: list[str], folder: Path) -> None:
    """Run commands as a reader would, one after the other, on the demo flight beside its truth."""
    truth = (ROOT / "fixtures" / "thesis_a2_truth.csv").read_text(encoding="utf-8")
    shutil.copy(ROOT / "fixtures" / "thesis_a2.mcap", folder / "flight.mcap")
    (folder / "truth.csv").write_text(truth, encoding="utf-8")
    renamed = truth.replace("time_s", "TIME", 1).replace("n1_pct", "NG", 1)
    (folder / "fdr.csv").write_text(renamed, encoding="utf-8")
    for line in lines:
        program, *words = line.split()
        done = ran(program, *words, cwd=folder)
        assert done.returncode == 0, (line, done.stderr)


@pytest.mark.slow
@pytest.mark.untraced
def test_commands_of_flight_data_run(tmp_path: Path) -> None:
    """Every command in docs/flight-data.md writes what it says."""
    (tmp_path / "names.yaml").write_text("n1_pct: {name: E1 NG, unit: '%'}\n", encoding="utf-8")
    text = (ROOT / "docs" / "flight-data.md").read_text(encoding="utf-8")
    inline = re.findall(r"`(decode flight\.mcap -o results[^`]*)`", text)
    fenced = [line for block in blocks(ROOT / "docs" / "flight-data.md") for line in block.splitlines()]
    commands = [*inline, *(line for line in fenced if line.startswith("decode ") and "fdr.csv" not in line)]
    # The demo's needles have no column of their own there.
    run_all([f"{line} --map names.yaml" if line.endswith("_g1000.csv") else line for line in commands], tmp_path)

    assert len(commands) >= 8
    assert (tmp_path / "results" / "flight.layout.json").exists()
    assert (tmp_path / "flight_g1000.csv").exists()
    assert any((tmp_path / "pictures").glob("*_fuel.jpg"))


@pytest.mark.slow
@pytest.mark.untraced
def test_commands_of_the_report_run(tmp_path: Path) -> None:
    """Every command in docs/report.md runs; the truth is in the page, by frame and by a clock."""
    (tmp_path / "names.yaml").write_text("n1_pct: {name: NG, unit: '%'}\n", encoding="utf-8")
    fenced = [line for block in blocks(ROOT / "docs" / "report.md") for line in block.splitlines()]
    run_all(fenced, tmp_path)
    page = (tmp_path / "results" / "flight.html").read_text(encoding="utf-8")

    assert len(fenced) == 4
    assert "Compared with the truth" in page
    assert "the curves suggest" in page
    assert "flight.mcap --method normxcorr --format html --truth fdr.csv --map names.yaml" in page


def test_readme_names_the_commands() -> None:
    """The first runs the demo, the second the tests; of each program those that a flight takes are named."""
    first = [line for block in blocks(ROOT / "README.md") for line in block.splitlines() if line.startswith("make ")]
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    box = ("run", "replay", "simulate", "info", "extract", "recover", "verify", "mark")
    desk = ("setup", "accuracy", "fleet", "frames", "export", "calibrate focal", "calibrate pose")
    shown = [*(f"recorder {command}" for command in box), *(f"decode {command}" for command in desk)]

    assert first[:2] == ["make demo", "make test"]
    assert [command for command in shown if command not in text] == []


def test_camera_examples_are_such() -> None:
    """The camera in docs/calibration.md is one; the settings in docs/qx10.md are taken, and none is missing."""
    (example,) = blocks(ROOT / "docs" / "qx10.md", "yaml")
    camera = yaml.safe_load(example)["camera"]

    assert parse_camera(blocks(ROOT / "docs" / "calibration.md", "yaml")[0]).lens(4.45, (4896, 3672)).distorts
    config = parse_config(yaml.safe_load(example))
    assert (config.camera.driver, str(config.storage.directory)) == ("qx10", "/var/lib/recorder")
    assert set(camera) == set(Qx10Settings.model_fields)


def test_live_camera_examples_are_such() -> None:
    """The settings in docs/cameras.md are taken, for each driver, and none is missing."""
    found = {}
    for example in blocks(ROOT / "docs" / "cameras.md", "yaml"):
        camera = yaml.safe_load(example)["camera"]
        found[camera["driver"]] = set(camera)
        config = parse_config(yaml.safe_load(example))
        assert config.camera.driver == camera["driver"]
        assert str(config.storage.directory) == "/var/lib/recorder"  # the service may write nowhere else

    models: dict[str, type[BaseModel]] = {"uvc": UvcSettings, "picamera": PicameraSettings, "rtsp": RtspSettings}
    assert found == {name: set(model.model_fields) for name, model in models.items()}


def test_every_fault_of_the_simulator_is_documented() -> None:
    """docs/qx10.md says what the driver does about each."""
    table = (ROOT / "docs" / "qx10.md").read_text(encoding="utf-8")

    assert [name for name in FAULTS if f"`{name}`" not in table] == []


PAGES = pages()
FOLDER = Path(__file__).parents[2] / "docs" / "reference"


@pytest.mark.parametrize("name", PAGES)
def test_page_is_up_to_date(name: str) -> None:
    """It is what `make reference` writes; run that after a change of a command or of a key."""
    assert (FOLDER / name).read_text(encoding="utf-8") == PAGES[name]


@pytest.mark.parametrize(("name", "program"), [("decode", decode), ("recorder", recorder)])
def test_every_command_has_its_place_and_shows_how_it_is_used(name: str, program: click.Group) -> None:
    """Those below other commands, too."""
    page = "\n" + command_pages(name, program)
    sections = dict(re.findall(r"\n## `([^`]+)`\n(.*?)(?=\n## |$)", page, re.DOTALL))

    assert list(sections) == command_names(name, program)
    assert [command for command, section in sections.items() if "  Examples:\n" not in section] == []
