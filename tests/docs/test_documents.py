"""The documents say what is: links lead somewhere, commands exist, examples are accepted."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from camera_drivers.qx10.simulator.faults import FAULTS
from decoder.camera import parse_camera
from decoder.garmin_columns import BY_NAME
from decoder.gauge import Gauge
from decoder.name_mapping import read_mapping
from decoder.panel import parse_panel
from recorder.config import parse_config
from recorder.settings import Qx10Settings

ROOT = Path(__file__).parents[2]
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "fixtures" / "README.md",
    *(ROOT / "docs").rglob("*.md"),
]


def blocks(document: Path, language: str = "") -> list[str]:
    """The fenced code blocks of a document in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", document.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_to_files(document: Path) -> None:
    """Every relative link names a file that is there."""
    links = re.findall(r"\]\((?!https?:)([^)#]+)", document.read_text(encoding="utf-8"))

    assert [link for link in links if not (document.parent / link).exists()] == []


def test_the_index_leads_to_every_page() -> None:
    """docs/README.md names each document of docs/."""
    docs = ROOT / "docs"
    links = set(re.findall(r"\]\(([^)#:]+)", (docs / "README.md").read_text(encoding="utf-8")))

    assert {str(page.relative_to(docs)) for page in docs.rglob("*.md")} - links == {"README.md"}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_targets_are_in_the_makefile(document: Path) -> None:
    """Every `make` command of a document is a target."""
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    text = document.read_text(encoding="utf-8")

    assert set(re.findall(r"`make ([a-z]+)`", text)) | set(re.findall(r"^make ([a-z]+)", text, re.MULTILINE)) <= targets


def test_readme_names_the_two_commands() -> None:
    """The README's first command runs the demo, its second the tests."""
    commands = [line for block in blocks(ROOT / "README.md") for line in block.splitlines() if line.startswith("make ")]

    assert commands[:2] == ["make demo", "make test"]


def test_panel_example_is_a_panel() -> None:
    """The panel in docs/panel.md is one that the decoder takes."""
    example, *_ = blocks(ROOT / "docs" / "panel.md", "yaml")

    assert parse_panel(example).gauges[0].needles[0].covered_by == "fuel_fr_lb"


def test_gauge_examples_are_gauges() -> None:
    """The single gauges in docs/panel.md are such as the decoder takes."""
    _, *examples = blocks(ROOT / "docs" / "panel.md", "yaml")

    assert examples
    for example in examples:
        assert Gauge.model_validate(yaml.safe_load(example)).name


def test_name_mappings_are_such(tmp_path: Path) -> None:
    """The mappings of names in docs/flight-data.md are such as the commands take; the first names G1000 columns."""
    found = []
    for number, example in enumerate(blocks(ROOT / "docs" / "flight-data.md", "yaml")):
        path = tmp_path / f"{number}.yaml"
        path.write_text(example, encoding="utf-8")
        found.append(read_mapping(path))

    assert {mapped.name for mapped in found[0].values()} <= set(BY_NAME)
    assert found[1]["airspeed_kt"].unit == "km/h"


@pytest.mark.slow
def test_commands_of_flight_data_run(tmp_path: Path) -> None:
    """Every command in docs/flight-data.md runs on the demo flight, one after the other, and writes what it says."""
    program = Path(sys.executable).parent
    shutil.copy(ROOT / "fixtures" / "thesis_a2.mcap", tmp_path / "flight.mcap")
    shutil.copy(ROOT / "fixtures" / "thesis_a2_truth.csv", tmp_path / "truth.csv")
    shutil.copy(ROOT / "fixtures" / "thesis_a2_truth.csv", tmp_path / "fdr.csv")
    (tmp_path / "names.yaml").write_text("n1_pct: {name: E1 NG, unit: '%'}\n", encoding="utf-8")
    text = (ROOT / "docs" / "flight-data.md").read_text(encoding="utf-8")
    inline = re.findall(r"`(decode flight\.mcap -o results[^`]*)`", text)
    fenced = [line for block in blocks(ROOT / "docs" / "flight-data.md") for line in block.splitlines()]
    commands = [*inline, *(line for line in fenced if line.startswith("decode ") and "fdr.csv" not in line)]

    for line in commands:
        mapped = line.endswith("-o flight_g1000.csv")  # the demo's needles have no column of their own there
        words = [str(program / "decode"), *line.split()[1:], *(["--map", "names.yaml"] if mapped else [])]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, (line, done.stderr)
    assert len(commands) >= 8
    assert (tmp_path / "results" / "flight.layout.json").exists()
    assert (tmp_path / "flight_g1000.csv").exists()
    assert any((tmp_path / "pictures").glob("*_fuel.jpg"))


@pytest.mark.slow
def test_commands_of_the_report_run(tmp_path: Path) -> None:
    """Every command in docs/report.md runs on the demo flight; the truth is in the page, by frame and by a clock."""
    program = Path(sys.executable).parent
    shutil.copy(ROOT / "fixtures" / "thesis_a2.mcap", tmp_path / "flight.mcap")
    truth = (ROOT / "fixtures" / "thesis_a2_truth.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "truth.csv").write_text("\n".join(truth), encoding="utf-8")
    renamed = [truth[0].replace("time_s", "TIME").replace("n1_pct", "NG"), *truth[1:]]
    (tmp_path / "fdr.csv").write_text("\n".join(renamed), encoding="utf-8")
    (tmp_path / "names.yaml").write_text("n1_pct: {name: NG, unit: '%'}\n", encoding="utf-8")
    fenced = [line for block in blocks(ROOT / "docs" / "report.md") for line in block.splitlines()]

    for line in fenced:
        done = subprocess.run(
            [str(program / "decode"), *line.split()[1:]], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, (line, done.stderr)
    page = (tmp_path / "results" / "flight.html").read_text(encoding="utf-8")
    assert len(fenced) == 3
    assert "Held against the truth" in page
    assert "the curves tell" in page
    assert "flight.mcap --method normxcorr --format html --truth fdr.csv --map names.yaml" in page


def test_camera_description_is_a_camera() -> None:
    """The camera in docs/calibration.md is one that the decoder takes."""
    example = blocks(ROOT / "docs" / "calibration.md", "yaml")[0]

    assert parse_camera(example).lens(4.45, (4896, 3672)).distorts


@pytest.mark.parametrize(
    "words",
    [
        *(
            ["recorder", command]
            for command in ("run", "replay", "simulate", "info", "extract", "recover", "verify", "mark")
        ),
        ["decode"],
        ["decode", "setup"],
        ["decode", "accuracy"],
        ["decode", "fleet"],
        ["decode", "frames"],
        ["decode", "export"],
        ["decode", "calibrate", "focal"],
        ["decode", "calibrate", "pose"],
    ],
)
def test_commands_of_the_readme_exist(words: list[str]) -> None:
    """Every command that the README shows answers --help with examples."""
    program = Path(sys.executable).parent / words[0]
    done = subprocess.run([str(program), *words[1:], "--help"], capture_output=True, text=True, check=False)

    assert " ".join(words) in (ROOT / "README.md").read_text(encoding="utf-8")
    assert done.returncode == 0
    assert "Examples:" in done.stdout


def test_camera_example_is_a_configuration() -> None:
    """The settings in docs/qx10.md are ones that the recorder takes, and none is missing."""
    (example,) = blocks(ROOT / "docs" / "qx10.md", "yaml")
    camera = yaml.safe_load(example)["camera"]

    assert parse_config(yaml.safe_load(example)).camera.driver == "qx10"
    assert set(camera) == set(Qx10Settings.model_fields)


def test_every_fault_of_the_simulator_is_documented() -> None:
    """docs/qx10.md says what the driver does about each."""
    table = (ROOT / "docs" / "qx10.md").read_text(encoding="utf-8")

    assert [name for name in FAULTS if f"`{name}`" not in table] == []
