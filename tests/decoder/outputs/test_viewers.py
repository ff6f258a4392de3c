"""What Foxglove and PlotJuggler make of our files, by Foxglove's published types and PlotJuggler's own rules.

Neither program runs here. Foxglove's types of panels are those of its SDK (`foxglove-sdk`, `foxglove.layouts`);
PlotJuggler's rules were read in its sources, `DataLoadMCAP/dataload_mcap.cpp` (10e0ae5) and
`DataLoadCSV/csv_parser.cpp` (19d8d0d), and are stated here once more.
"""

from __future__ import annotations

import io
import json
import re
from typing import Any

import pytest
from mcap.reader import make_reader
from pydantic import TypeAdapter

from decoder.imaging.panel_pictures import PanelPictures
from decoder.instruments.reading import Status
from decoder.timeseries.flight_data import FlightData
from tests.decoder.cockpit import fly, reading
from tests.decoder.outputs.test_mcap_output import CAMERA, frame, written
from tests.programs import ROOT

# Encodings of messages of ours for which PlotJuggler brings a parser: `nlohmann_parsers.h`, `ParserProtobuf`.
ITS_PARSERS = {"json", "protobuf"}
DELIMITERS = "\t;, "  # in the order in which it prefers them


@pytest.fixture
def data() -> FlightData:
    """A flight in which everything optional is missing somewhere."""
    gone = {"speed_kt": reading(271.0, Status.MISSING, 0.41)}
    return fly([gone, {"speed_kt": reading(270.0)}, "knob not found", {"speed_kt": reading(345.0, Status.EDGE, 0.9)}])


def snaked(given: Any) -> Any:  # noqa: ANN401 - of JSON
    """JSON's keys as the SDK names its fields; topics stay as they are."""
    if isinstance(given, dict):
        return {key if key[0] == "/" else re.sub("[A-Z]", lambda it: "_" + it[0].lower(), key): snaked(each)
                for key, each in given.items()}  # fmt: skip
    return [snaked(each) for each in given] if isinstance(given, list) else given


def test_each_panel_of_a_layout_is_what_foxglove_publishes() -> None:
    """Every setting belongs to its type, with an allowed value, and comes back unchanged from the SDK."""
    types = pytest.importorskip("foxglove.layouts", reason="needs foxglove-sdk, which is not part of the project")
    configs = {"Image": types.ImageConfig, "Plot": types.PlotConfig, "StateTransitions": types.StateTransitionsConfig}
    layout = json.loads((ROOT / "docs" / "foxglove-layout.json").read_text(encoding="utf-8"))

    for name, config in layout["configById"].items():
        own = {key: value for key, value in config.items() if key != "foxglovePanelTitle"}  # of the app, for any panel
        panel = TypeAdapter(configs[name.partition("!")[0]]).validate_python(snaked(own))
        assert json.loads(panel.to_json()) == own


def test_a_layout_arranges_each_of_its_panels_once() -> None:
    """The layout is a binary tree, as the app exports it, with the panels as leaves."""
    layout = json.loads((ROOT / "docs" / "foxglove-layout.json").read_text(encoding="utf-8"))

    def leaves(part: Any) -> list[str]:  # noqa: ANN401 - a name, or a part with two
        if isinstance(part, str):
            return [part]
        assert set(part) == {"direction", "first", "second", "splitPercentage"}
        assert part["direction"] in {"row", "column"}
        assert 0 < part["splitPercentage"] < 100
        return leaves(part["first"]) + leaves(part["second"])

    assert set(layout) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])


def test_plotjuggler_finds_a_parser_for_each_topic(data: FlightData, panel: PanelPictures) -> None:
    """It reads the summary, and asks for each channel's schema by its number and for a parser by its encoding."""
    content = written(data, panel, [frame(index) for index in range(4)], CAMERA)
    summary = make_reader(io.BytesIO(content)).get_summary()

    assert summary is not None
    assert summary.statistics is not None
    assert len(summary.channels) > 3
    for channel in summary.channels.values():
        assert channel.schema_id in summary.schemas
        assert channel.message_encoding in ITS_PARSERS
        assert summary.statistics.channel_message_counts.get(channel.id, 0) > 0


def split(line: str) -> list[str]:
    """A line as PlotJuggler splits it: quotes hold a part together, and nothing is escaped in them."""
    return [part.strip().strip('"') for part in re.findall(r'(?:^|,)("[^"]*"|[^,]*)', line)]


def is_number(text: str) -> bool:
    """Whether PlotJuggler plots it as a number."""
    return re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", text) is not None


@pytest.mark.parametrize("flight", ["thesis_a1", "thesis_a2"])
def test_plotjuggler_reads_each_row_and_column_of_a_table(flight: str) -> None:
    """The comma is its delimiter, no row is skipped, time never goes back, and what begins as numbers stays numbers."""
    header, *lines = (ROOT / "tests" / "references" / f"{flight}.csv").read_text(encoding="utf-8").splitlines()
    counts = {each: header.count(each) for each in DELIMITERS}
    names = split(header)
    rows = [split(line) for line in lines]

    assert max(counts, key=lambda each: counts[each]) == ","
    assert len(set(names)) == len(names)
    assert all(names)
    assert {len(row) for row in rows} == {len(names)}
    times = [float(row[names.index("time_s")]) for row in rows]
    assert times == sorted(times)
    for column in zip(*rows, strict=True):
        told = [each for each in column if each]
        assert len({is_number(each) for each in told}) <= 1
