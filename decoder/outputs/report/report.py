"""`NAME.html`: the report. The page is made first, then frames are read again to insert pictures of some of them.

Given their uncertainty, values need only single precision, and a status is a byte, so seven needles of a two-hour
flight at 4 Hz take 2.6 MB.

Frames pass one at a time and are written as they come, so memory does not grow with the pictures. The time of writing
is not included: the same flight gives the same bytes.
"""

from __future__ import annotations

import base64
import json
import re
from base64 import b64encode
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from hashlib import sha256
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import IO, Any
from urllib.parse import quote

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray

from decoder.imaging.pictures import colour_picture
from decoder.imaging.video import GroupDecoder, encoded_of
from decoder.learning.budget import Budget
from decoder.outputs.csv_output import moment_text
from decoder.outputs.drawn_readings import STATUS_COLOURS, DrawnGauge, ReadingPlaces, label_decimals
from decoder.outputs.explanation import CAUSE_WORDS, FRAME_WORDS, STATUS_WORDS
from decoder.outputs.film import film_times_s
from decoder.outputs.frame_picture import matched_frames
from decoder.outputs.outputs import Decoded
from decoder.outputs.report import facts
from decoder.outputs.report.drawings import calibration_charts, panel_drawing
from decoder.outputs.report.facts import AlignmentTrack, Order, alignment_tracks, order_of
from decoder.outputs.report.flags import KINDS, Evidence, Flag, Kind, evidence, find_flags, picture_plan
from decoder.outputs.thresholds import LARGEST_BYTES
from decoder.panel.camera import Camera
from decoder.panel.errors import PictureError
from decoder.panel.scale import shortest
from decoder.timeseries.cross_checks import cross_checks, parameters_of
from decoder.timeseries.flight_data import STATUSES, FlightData, NeedleSeries
from flight_file.frame import Frame

PAGE = files("decoder.outputs.report") / "page"
SHARED = files("decoder.setup") / "page"
PLOTLY = files("decoder.outputs") / "vendor" / "plotly-basic.min.js"
STYLES = ("style.css", "parts.css", "print.css")
_IMPORT = re.compile(r'^import \{[^}]*\} from "\./([a-z]+\.js)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:const|class|function|async) )", re.MULTILINE)

# The start of a flight of unknown time in the plots, since plotly takes milliseconds from 1000 to 9999 for years.
MIDNIGHT_MS = 946_684_800_000
BESIDE, NOWHERE = "'self' file:", "'none'"  # where media may come from
PLACE_OF_EVIDENCE = "<!--evidence-->"
INTEGRITY_SAYS = {"good": "fits", "warn": "see below", "bad": "DOES NOT FIT", "open": "not checked"}


def style() -> str:
    """Read all style sheets."""
    return "\n".join((PAGE / name).read_text(encoding="utf-8") for name in STYLES)


def script() -> str:
    """Return all modules that `main.js` needs, each after those it imports, in one scope of their own."""
    done: dict[str, str] = {}
    _collect("main.js", done)
    return '"use strict";\n{\n' + "\n".join(done.values()) + "}\n"


def plotly() -> str:
    """Return plotly.js with its basic plots as published; `vendor/README.md` says where it is from."""
    return PLOTLY.read_text(encoding="utf-8")


def security_policy(scripts: Iterator[str], media: str) -> str:
    """Allow a page these scripts, its own styles, embedded pictures, and media from `media`, and no network."""
    hashes = " ".join(f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in scripts)
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:;"
        f" media-src {media};"
        " base-uri 'none'; form-action 'none'"
    )


def _collect(name: str, done: dict[str, str]) -> None:
    text = _module(name).read_text(encoding="utf-8")
    for needed in _IMPORT.findall(text):
        if needed not in done:
            _collect(needed, done)
    done[name] = _EXPORT.sub("", _IMPORT.sub("", text))


def _module(name: str) -> Traversable:
    own = PAGE / name
    return own if own.is_file() else SHARED / name


def packed(values: NDArray[Any], kind: str) -> dict[str, str]:
    """Encode an array for the page; `kind` is numpy's name for its numbers, such as `f4`."""
    return {"kind": kind, "data": base64.b64encode(np.ascontiguousarray(values, "<" + kind).tobytes()).decode()}


def columns(data: FlightData, order: Order) -> dict[str, Any]:
    """Encode times, frame numbers and needles for the page."""
    start_ns = int(data.time_ns[order[0]]) if order.size else 0
    named = [(series.quantity.name, series) for series in data.series]
    signed = {name for name, parameter in parameters_of(data).items() if parameter == "roll"}
    return {
        "rows": int(order.size),
        "start_ms": start_ns / 1e6 + (0 if data.knows_time_of_day else MIDNIGHT_MS),
        "start_utc": moment_text(data, start_ns),
        "since_first_ms": float(data.time_ns[0] - start_ns) / 1e6 - float(data.time_s[0]) * 1e3 if order.size else 0.0,
        "time_ms": packed((data.time_ns[order] - start_ns) / 1e6, "f8"),
        "frame": packed(data.frame[order], "f8"),
        "needles": [_needle(series, order, data.budgets.get(name), is_signed=name in signed) for name, series in named],
        "frame_causes": {status.value: words for status, words in FRAME_WORDS.items()},
    }


def _needle(series: NeedleSeries, order: Order, budget: Budget | None, *, is_signed: bool) -> dict[str, Any]:
    """Encode a needle; bank is signed here even if a ring of marks counts it from 0 to 360."""
    quantity = series.quantity
    value = shortest(series.value[order], quantity.wraps) if is_signed else series.value[order]
    return {
        "name": quantity.name,
        "gauge": quantity.gauge,
        "unit": quantity.unit,
        "decimals": label_decimals(series),
        "wraps": quantity.wraps,
        "full_scale": quantity.full_scale,
        # Every digit of a display counts.
        "value": packed(value, "f4" if quantity.written is None else "f8"),
        "written": None if quantity.written is None else asdict(quantity.written),
        "sigma": packed(series.sigma[order], "f4"),
        "score": packed(series.score[order], "f4"),
        "status": packed(series.status[order], "u1"),
        "budget": None
        if budget is None
        else {
            "values": budget.values.tolist(),
            "turn": budget.turn,
            "sigmas": [[CAUSE_WORDS[cause], packed(sigma, "f4")] for cause, sigma in budget.sigmas.items()],
        },
    }


def write_report(report: Decoded, stream: IO[bytes], *, largest_bytes: int = LARGEST_BYTES) -> None:
    """Write the report as one self-contained HTML page.

    Parameters
    ----------
    largest_bytes
        Its maximum size; only as many pictures are included as that allows, but its data are never thinned.

    Raises
    ------
    OutputError
        If the flight file does not give the same frames as before.
    PanelError, CameraError
        If the panel cannot be drawn.
    """
    flags, order = find_flags(report.data), order_of(report.data)
    page = _page(report, flags, order)
    before, after = (part.encode(errors="backslashreplace") for part in page.split(PLACE_OF_EVIDENCE))
    stream.write(before)
    room_bytes = min(largest_bytes // 2, largest_bytes - len(before) - len(after))
    for block in _evidence(report, flags, order, room_bytes):
        stream.write(block)
    stream.write(after)


def _evidence(report: Decoded, flags: Sequence[Flag], order: Order, room_bytes: int) -> Iterator[bytes]:
    """Cut pictures from one frame after the other, as many as there is room for."""
    data = report.data
    places, position = ReadingPlaces(report.source, data), _positions(order)
    needles = {series.quantity.name: place for place, series in enumerate(data.series)}
    plan = picture_plan(data, flags, len(report.source.panel.gauges), room_bytes)
    video = GroupDecoder()
    for row, frame in enumerate(matched_frames(data, report.frames)):
        if row not in plan.rows:
            continue
        cut = partial(evidence, places=needles, frame_px=plan.frame_px(row), has_crops=plan.has_crops)
        found = _evidence_of(frame, video, places.frame(row), cut)
        head = f'<script type="application/json" class="evidence" data-row="{position[row]}">'
        block = f"{head}{_json(found)}</script>\n".encode(errors="backslashreplace")
        room_bytes -= len(block)
        if room_bytes < 0:  # they are larger than estimated
            return
        yield block


def _evidence_of(
    frame: Frame, video: GroupDecoder, gauges: Sequence[DrawnGauge], cut: Callable[..., Evidence]
) -> Evidence:
    try:
        return cut(colour_picture(encoded_of(frame), video), gauges)
    except PictureError as error:
        return {"trouble": str(error)}


def _page(report: Decoded, flags: Sequence[Flag], order: Order) -> str:
    environment = Environment(
        loader=PackageLoader("decoder.outputs.report", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    tracks = alignment_tracks(report.data, report.source.optics.size_px)
    scripts = {"plotly": plotly(), "script": script()}
    charts = [] if report.camera is None else calibration_charts(report.camera, report.source.optics.focal_length_mm)
    page: str = environment.get_template("report.html").render(
        **_texts(report, flags, order),
        policy=security_policy(iter(scripts.values()), BESIDE if report.film else NOWHERE),
        film=quote(report.film),
        style=Markup(style()),  # noqa: S704 - our own file
        **{name: Markup(text) for name, text in scripts.items()},  # noqa: S704 - our own, and plotly's
        flight_json=Markup(_json(_flight(report, flags, order, tracks))),  # noqa: S704 - contains no `<`
        charts_json=Markup(_json(charts)),  # noqa: S704 - the same
        alignment=facts.alignment_facts(tracks),
        charts=charts,
    )
    return page


def _texts(report: Decoded, flags: Sequence[Flag], order: Order) -> dict[str, Any]:
    """Collect the template's texts outside its scripts."""
    data, source, provenance = report.data, report.source, report.provenance
    listed, left_out = facts.listed_flags(data, flags, _positions(order))
    counts = [(kind.value, sum(flag.kind is kind for flag in flags)) for kind in KINDS]
    checked = facts.checked(report.check())
    return {
        "provenance": provenance,
        "when": facts.when(data),
        "clock": facts.clock(data, report.session),
        "checks": cross_checks(data),
        "sections": _sections(report),
        "facts": facts.head_facts(
            data,
            flags,
            provenance.losses,
            facts.Fact("recording's chain", INTEGRITY_SAYS[checked[0].state], checked[0].state),
        ),
        "alerts": facts.alerts(data, provenance.losses, order),
        "statuses": [*STATUS_WORDS.items()],
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
        "checked": checked,
        "files": _files(report),
        "made_with": _made_with(report),
    }


def _sections(report: Decoded) -> list[tuple[str, str]]:
    wanted = [
        ("data", "Flight data", True),
        ("flagged", "Events and flags", True),
        ("checks", "Cross-checks", bool(cross_checks(report.data))),
        ("accuracy", "Accuracy", report.truth is not None),
        ("alignment", "Alignment", bool(report.data.alignments)),
        ("setup", "Set-up", True),
        ("calibration", "Calibration", report.camera is not None),
        ("notes", "Notes", True),
        ("provenance", "Provenance", True),
    ]
    return [(name, title) for name, title, is_there in wanted if is_there]


def _flight(report: Decoded, flags: Sequence[Flag], order: Order, tracks: Sequence[AlignmentTrack]) -> dict[str, Any]:
    """Collect what the page's scripts read."""
    data = report.data
    position, row_of = _positions(order), {int(frame): row for row, frame in enumerate(data.frame)}
    needles = {series.quantity.name: place for place, series in enumerate(data.series)}
    content = columns(data, order)
    for place, needle in enumerate(content["needles"]):
        truth = None if report.truth is None else report.truth.values.get(data.series[place].quantity.name)
        needle["truth"] = None if truth is None else packed(truth[order], "f4")
    content["about"] = _about(report, content)
    return {
        **content,
        "film_s": packed(film_times_s(data)[order], "f8") if report.film else None,
        "statuses": [status.value for status in STATUSES],
        "flags": [
            [
                *sorted((int(position[flag.first]), int(position[flag.last]))),
                flag.kind.value,
                needles.get(flag.needle, -1),
            ]
            for flag in flags
        ],
        "checks": [
            {
                "names": check.names,
                "unit": check.unit,
                "one": packed(check.one[order], "f4"),
                "other": packed(check.other[order], "f4"),
                "apart": [
                    sorted((int(position[each.first]), int(position[each.last]))) for each in check.disagreements
                ],
            }
            for check in cross_checks(data)
        ],
        "lost": {str(position[row_of[missing.frame]]): missing.reason for missing in data.missing_frames},
        "alignment": [
            {"values": packed(track.values[order], "f4"), "least": track.least, "name": track.name} for track in tracks
        ],
    }


def _about(report: Decoded, content: Mapping[str, Any]) -> dict[str, Any]:
    """Identify what notes on this page refer to: the files that it is made from, and the data that it shows."""
    return {
        "recording": report.provenance.recording,
        "name": report.name,
        "software": report.provenance.software,
        "files": _files(report),
        "data_sha256": sha256(_json(content).encode(errors="backslashreplace")).hexdigest(),
    }


def _files(report: Decoded) -> list[dict[str, str]]:
    provenance = report.provenance
    rows = [{"name": file.name, "what": "flight file", "sha256": file.sha256} for file in provenance.flight_files]
    rows.append({"name": provenance.panel.name, "what": "panel", "sha256": provenance.panel.sha256})
    if provenance.camera is not None:
        rows.append({"name": provenance.camera.name, "what": "camera", "sha256": provenance.camera.sha256})
    if report.truth is not None:
        rows.append({"name": report.truth.name, "what": "truth", "sha256": report.truth.sha256})
    return rows


def _made_with(report: Decoded) -> list[tuple[str, str]]:
    own = [
        ("software", report.provenance.software),
        ("method", report.provenance.method),
        ("command", report.command),
    ]
    return [*own, *facts.recorded_by(report.session)]


def _camera_words(camera: Camera | None) -> str:
    if camera is None:
        return ""
    low, high = camera.focal.range_mm
    name = camera.model or "A camera without a name"
    lens = "with distortion" if camera.distortion else "no distortion was measured, so none is corrected"
    return f"{name}, calibrated from {low:g} to {high:g} mm; {lens}."


def _positions(order: Order) -> Order:
    """(N,): the rank of each row in order of time."""
    position = np.empty_like(order)
    position[order] = np.arange(order.size)
    return position


def _json(content: object) -> str:
    """Encode JSON that is safe in a script element: nothing in it can end the element."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
