"""The documents say what is: links lead somewhere, commands exist, examples are accepted."""

from __future__ import annotations

import re
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
from recorder.config import Qx10Settings, parse_config

ROOT = Path(__file__).parents[2]
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "fixtures" / "README.md",
    *(ROOT / "docs").glob("*.md"),
]


def blocks(document: Path, language: str = "") -> list[str]:
    """The fenced code blocks of a document in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", document.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_to_files(document: Path) -> None:
    """Every relative link names a file that is there."""
    links = re.findall(r"\]\((?!https?:)([^)#]+)", document.read_text(encoding="utf-8"))

    assert [link for link in links if not (document.parent / link).exists()] == []


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


def test_name_mapping_is_one(tmp_path: Path) -> None:
    """The mapping of names in docs/flight-data.md is one that `decode export` takes, for columns that there are."""
    example, *_ = blocks(ROOT / "docs" / "flight-data.md", "yaml")
    (tmp_path / "names.yaml").write_text(example, encoding="utf-8")

    assert {mapped.name for mapped in read_mapping(tmp_path / "names.yaml").values()} <= set(BY_NAME)


def test_camera_description_is_a_camera() -> None:
    """The camera in docs/calibration.md is one that the decoder takes."""
    example = blocks(ROOT / "docs" / "calibration.md", "yaml")[0]

    assert parse_camera(example).lens(4.45, (4896, 3672)).distorts


@pytest.mark.parametrize(
    "words",
    [
        *(["recorder", command] for command in ("run", "simulate", "info", "recover", "verify", "mark")),
        ["decode"],
        ["decode", "accuracy"],
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
