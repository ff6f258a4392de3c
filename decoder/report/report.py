"""`NAME.html`: the report. The page is made first, then the frames are read again, and pictures of some put into it.

Frames pass one at a time and are written as they come, so memory does not grow with the pictures. Nothing of the time
of writing goes in: the same flight gives the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from decoder.camera import Camera
from decoder.drawn_readings import ReadingPlaces
from decoder.errors import PictureError
from decoder.flight_data import STATUSES, FlightData
from decoder.frames_again import Frames, matched_frames
from decoder.json_output import Provenance
from decoder.panel_pictures import PanelPictures
from decoder.pictures import colour_picture
from decoder.report import facts
from decoder.report.alignment_summary import AlignmentTrack, alignment_tracks
from decoder.report.bundle import plotly, script, security_policy, style
from decoder.report.calibration_charts import calibration_charts
from decoder.report.choosing import Room, planned
from decoder.report.columns import Order, columns, order_of, packed
from decoder.report.evidence import Evidence, evidence, likely_bytes
from decoder.report.flags import KINDS, Flag, Kind, find_flags
from decoder.report.integrity import Checked
from decoder.report.panel_drawing import panel_drawing
from decoder.report.truth_section import TruthSection
from decoder.status_colours import STATUS_COLOURS
from flight_file.frame import Frame

LARGEST_BYTES = 24_000_000
PICTURES_BYTES = 13_000_000
FEWEST_PICTURES_BYTES = 1_000_000
PLACE_OF_EVIDENCE = "<!--evidence-->"
INTEGRITY_SAYS = {"good": "fits", "warn": "see below", "bad": "DOES NOT FIT", "open": "not checked"}


@dataclass(frozen=True, slots=True)
class Report:
    """All that a report is made of.

    Attributes
    ----------
    frames
        Reads the flight's frames once more; None for a report without pictures of frames.
    checked
        What is known of the recording's integrity, the chain first.
    recorded_by
        What the recording says of its recorder and camera: (what, says) each.
    command
        The command that makes it again.
    name
        Of the files that the flight data are in, without their ends.
    truth
        What it was held against, if it was.
    """

    data: FlightData
    source: PanelPictures
    camera: Camera | None
    provenance: Provenance
    frames: Frames | None
    checked: Sequence[Checked]
    recorded_by: Sequence[tuple[str, str]]
    command: str
    name: str
    truth: TruthSection | None = None


def write_report(report: Report, stream: IO[bytes], *, largest_bytes: int = LARGEST_BYTES) -> None:
    """Writes the report as one HTML page that needs nothing else.

    Parameters
    ----------
    largest_bytes
        How large it may become; as few pictures as that allows are put in, but its data are never thinned out.

    Raises
    ------
    OutputError
        If the flight file does not give the frames that it gave before.
    PanelError, CameraError
        If the panel cannot be drawn.
    """
    flags, order = find_flags(report.data), order_of(report.data)
    page = _page(report, flags, order)
    before, after = (part.encode() for part in page.split(PLACE_OF_EVIDENCE))
    stream.write(before)
    if report.frames is not None:
        room_bytes = min(PICTURES_BYTES, max(largest_bytes - len(before) - len(after), FEWEST_PICTURES_BYTES))
        for block in _evidence(report, report.frames, flags, order, room_bytes):
            stream.write(block)
    stream.write(after)


def _evidence(report: Report, frames: Frames, flags: Sequence[Flag], order: Order, room_bytes: int) -> Iterator[bytes]:
    """The pictures of one frame after the other, for as many as there is room for."""
    data = report.data
    places, position = ReadingPlaces(report.source, data), _positions(order)
    needles = {series.quantity.name: place for place, series in enumerate(data.series)}
    room = Room(planned(data, flags), room_bytes, likely_bytes(len(report.source.panel.gauges)))
    for row, frame in enumerate(matched_frames(data, frames)):
        if not room.has_for(row):
            continue
        found = _evidence_of(frame, places, row, needles)
        head = f'<script type="application/json" class="evidence" data-row="{position[row]}">'
        block = f"{head}{_json(found)}</script>\n".encode()
        if room.take(len(block)):
            yield block


def _evidence_of(frame: Frame, places: ReadingPlaces, row: int, needles: dict[str, int]) -> Evidence:
    try:
        return evidence(colour_picture(frame.jpeg), places.frame(row), needles)
    except PictureError as error:
        return {"trouble": str(error)}


def _page(report: Report, flags: Sequence[Flag], order: Order) -> str:
    environment = Environment(
        loader=PackageLoader("decoder.report", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    height, width = report.source.picture.shape
    tracks = alignment_tracks(report.data, (width, height))
    scripts = {"plotly": plotly(), "script": script()}
    charts = [] if report.camera is None else calibration_charts(report.camera, report.source.panel.focal_length_mm)
    page: str = environment.get_template("report.html").render(
        **_texts(report, flags, order),
        policy=security_policy(iter(scripts.values())),
        style=Markup(style()),  # noqa: S704 - our own file
        **{name: Markup(text) for name, text in scripts.items()},  # noqa: S704 - our own, and plotly's
        flight_json=Markup(_json(_flight(report, flags, order, tracks))),  # noqa: S704 - no `<` is left in it
        charts_json=Markup(_json(charts)),  # noqa: S704 - the same
        alignment=facts.alignment_facts(tracks),
        charts=charts,
    )
    return page


def _texts(report: Report, flags: Sequence[Flag], order: Order) -> dict[str, Any]:
    """What the template says outside its scripts."""
    data, source, provenance = report.data, report.source, report.provenance
    listed, left_out = facts.listed_flags(data, flags, _positions(order))
    counts = [(kind.value, sum(flag.kind is kind for flag in flags)) for kind in KINDS]
    chain = report.checked[0] if report.checked else Checked("open", "chain and digests", "")
    return {
        "provenance": provenance,
        "when": facts.when(data),
        "sections": _sections(report),
        "facts": facts.head_facts(
            data, flags, provenance.losses, facts.Fact("recording's chain", INTEGRITY_SAYS[chain.state], chain.state)
        ),
        "alerts": facts.alerts(data, provenance.losses, order),
        "statuses": facts.STATUS_WORDS,
        "status_colours": {status.value: colour for status, colour in STATUS_COLOURS.items()},
        "has_outliers": any(flag.kind is Kind.OUTLIER for flag in flags),
        "needles": [facts.needle_facts(series) for series in data.series],
        "kinds": [(kind, count) for kind, count in counts if count],
        "flags": listed,
        "left_out": left_out,
        "json_name": f"{report.name}.json",
        "truth": report.truth,
        "failed_anchors": facts.failed_anchors(data.alignments),
        "panel": source.panel,
        "drawing": panel_drawing(source, dict(data.moved_pivots_px)),
        "has_points": bool(source.panel.reference_points),
        "gauge_rows": facts.gauge_rows(source, data),
        "camera_words": _camera_words(report.camera),
        "checked": report.checked,
        "files": _files(report),
        "made_with": _made_with(report),
        "pictures_words": _pictures_words(report),
    }


def _sections(report: Report) -> list[tuple[str, str]]:
    wanted = [
        ("data", "Flight data", True),
        ("flagged", "Gaps and flags", True),
        ("accuracy", "Accuracy", report.truth is not None),
        ("alignment", "Alignment", bool(report.data.alignments)),
        ("setup", "Set-up", True),
        ("calibration", "Calibration", report.camera is not None),
        ("provenance", "Provenance", True),
    ]
    return [(name, title) for name, title, is_there in wanted if is_there]


def _flight(report: Report, flags: Sequence[Flag], order: Order, tracks: Sequence[AlignmentTrack]) -> dict[str, Any]:
    """What the page's scripts read."""
    data = report.data
    position, row_of = _positions(order), {int(frame): row for row, frame in enumerate(data.frame)}
    needles = {series.quantity.name: place for place, series in enumerate(data.series)}
    content = columns(data, order)
    for place, needle in enumerate(content["needles"]):
        truth = None if report.truth is None else report.truth.values.get(data.series[place].quantity.name)
        needle["truth"] = None if truth is None else packed(truth[order], "f4")
    return {
        **content,
        "statuses": [status.value for status in STATUSES],
        "flags": [
            [
                *sorted((int(position[flag.first]), int(position[flag.last]))),
                flag.kind.value,
                needles.get(flag.needle, -1),
            ]
            for flag in flags
        ],
        "lost": {str(position[row_of[missing.frame]]): missing.reason for missing in data.missing_frames},
        "alignment": [
            {"values": packed(track.values[order], "f4"), "least": track.least, "name": track.name} for track in tracks
        ],
    }


def _files(report: Report) -> list[dict[str, str]]:
    provenance = report.provenance
    rows = [{"name": file.name, "what": "flight file", "sha256": file.sha256} for file in provenance.flight_files]
    rows.append({"name": provenance.panel.name, "what": "panel", "sha256": provenance.panel.sha256})
    if provenance.camera is not None:
        rows.append({"name": provenance.camera.name, "what": "camera", "sha256": provenance.camera.sha256})
    if report.truth is not None:
        rows.append({"name": report.truth.name, "what": "truth", "sha256": report.truth.sha256})
    return rows


def _made_with(report: Report) -> list[tuple[str, str]]:
    own = [
        ("software", report.provenance.software),
        ("method", report.provenance.method),
        ("command", report.command),
    ]
    return [*own, *report.recorded_by]


def _camera_words(camera: Camera | None) -> str:
    if camera is None:
        return ""
    low, high = camera.focal.range_mm
    name = camera.model or "A camera without a name"
    lens = "with distortion" if camera.distortion else "no distortion was measured, none is taken out"
    return f"{name}, calibrated from {low:g} to {high:g} mm; {lens}."


def _pictures_words(report: Report) -> str:
    if report.frames is None:
        return "No pictures of frames are in this report."
    return (
        "Pictures are of the frames with flags, of extremes and steps, and of frames spread over the flight, as far as"
        " the page's size allows; the recording has them all."
    )


def _positions(order: Order) -> Order:
    """(N,): the place of each row in the order of time."""
    position = np.empty_like(order)
    position[order] = np.arange(order.size)
    return position


def _json(content: object) -> str:
    """JSON that a script element can hold: nothing in it can end the element."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
