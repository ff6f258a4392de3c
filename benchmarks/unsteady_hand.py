"""`python -m benchmarks.unsteady_hand [TITLE ...]`: what a panel costs that is drawn worse, or on another picture.

Each source of `real_pictures` is decoded with its panel as it is, with centres and marks drawn by an unsteady hand, and
drawn on other pictures of the same camera: with needles where the truth has them, or, if that is known of few pictures,
where they were read. The hand is the same in every run.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml

from benchmarks.real_pictures import Read, Source, available, decode_source, reads, truth_of
from decoder.outputs.csv_output import text_table
from decoder.panel.arrays import Floats
from decoder.panel.scale import Scale
from decoder.timeseries.tables import read_table
from flight_file.reader import spread

SEED = 19
CENTRE_PARTS, MARK_DEG = (0.03, 0.08), 1.0
HOLDS = 0.9
OTHER_PICTURES = 6
HEADER = ("source", "drawn", "needles", "valued", "read", "2 % off", "in 95 %", "rows in 95 %", "mean % FS")
Document = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Drawn:
    """A way to draw a source's panel, and what came of it; no reads where `decode` refused it."""

    title: str
    manner: str
    reads: Sequence[Read]


def manners(source: Source, folder: Path) -> Iterator[tuple[str, Source]]:
    """The source with its panel as it is, by unsteady hands, and on other pictures; panels are written to a folder."""
    yield "as it is", source
    document = yaml.safe_load(source.panel.read_text(encoding="utf-8"))
    for part in CENTRE_PARTS:
        for manner, draw in (("", _unsteady), (", clicked", _clicked)):
            hand = np.random.default_rng(SEED)
            drawn = {**document, "gauges": [draw(gauge, part, hand) for gauge in document["gauges"]]}
            path = folder / f"{part}{manner[2:]}.yaml"
            yield f"centres {part:.0%} off, marks {MARK_DEG:.0f} deg{manner}", _written(source, drawn, path)
    yield from _on_other_pictures(source, document, folder)


def _unsteady(gauge: Document, part: float, hand: np.random.Generator) -> Document:
    """A gauge whose centre is off by a part of its outer radius, in any direction, and each mark by itself.

    A ball's tube is off as a whole, and of a window each corner, by a part of half their length.
    """
    towards = hand.uniform(0, 2 * np.pi)
    if "ball" in gauge:
        return {**gauge, "ball": _beside(gauge["ball"], part, towards)}
    if "window" in gauge:
        corners = np.array(gauge["window"], float)
        most_px = part / 2 * np.hypot(*np.ptp(corners, axis=0))
        return {**gauge, "window": (corners + hand.uniform(-most_px, most_px, corners.shape)).tolist()}
    off_px = part * gauge["radius"][1] * np.array([np.cos(towards), np.sin(towards)])
    centre = [float(at) for at in np.add(gauge["centre"], off_px)]
    return {**gauge, "centre": centre, "scale": _shaken(gauge["scale"], hand)}


def _clicked(gauge: Document, part: float, hand: np.random.Generator) -> Document:
    """The same by somebody who clicks on marks and needles: each is a point, seen from the centre that is off."""
    drawn = _unsteady(gauge, part, hand)
    if "ball" in gauge or "window" in gauge:  # its places are points already
        return drawn
    off_px = np.subtract(drawn["centre"], gauge["centre"])

    def seen_deg(angle_deg: float) -> float:
        angle = np.radians(angle_deg)
        x, y = gauge["radius"][1] * np.array([np.cos(angle), np.sin(angle)]) - off_px
        return float(angle_deg + (np.degrees(np.arctan2(y, x)) - angle_deg + 180) % 360 - 180)

    def seen(marks: Sequence[Sequence[float]]) -> list[list[float]]:
        return [[seen_deg(angle), value] for angle, value in marks]

    if gauge["sweep"][1] - gauge["sweep"][0] < 360:  # noqa: PLR2004 - else it has no ends
        drawn["sweep"] = [seen_deg(end) for end in gauge["sweep"]]
    drawn["scale"] = seen(drawn["scale"])
    if "card" in gauge:
        drawn["card"] = {**gauge["card"], "index": seen_deg(gauge["card"]["index"])}
    if "needles" in gauge:
        drawn["needles"] = [
            {
                **needle,
                "template": {**needle["template"], "at": seen_deg(needle["template"]["at"])},
                **({"scale": seen(needle["scale"])} if "scale" in needle else {}),
            }
            for needle in gauge["needles"]
        ]
    return drawn


def _beside(ball: Document, part: float, towards: float) -> Document:
    """A ball's tube that is off by a part of half its length."""
    tube = np.array(ball["tube"], float)
    off_px = part / 2 * np.hypot(*(tube[-1] - tube[0])[:2])
    tube[:, :2] += off_px * np.array([np.cos(towards), np.sin(towards)])
    return {**ball, "tube": tube.tolist()}


def _shaken(scale: Sequence[Sequence[float]], hand: np.random.Generator) -> list[list[float]]:
    angles = np.array([angle for angle, _ in scale], float) + hand.uniform(-MARK_DEG, MARK_DEG, len(scale))
    return [[float(angle), value] for angle, (_, value) in zip(np.sort(angles), scale, strict=True)]


def _on_other_pictures(source: Source, document: Document, folder: Path) -> Iterator[tuple[str, Source]]:
    """With the needle's place in each, as far as the truth tells it, or what was read."""
    pictures = sorted(source.folder.glob(source.pictures))
    if source.tolerance:
        yield from on_pictures_read(source, document, folder, OTHER_PICTURES)
    elif source.same_view:
        truth = truth_of(source, [picture.stem for picture in pictures])
        for number in np.linspace(0, len(pictures) - 1, OTHER_PICTURES).round().astype(int):
            shown = {name: each[number] for name, each in truth.items()}
            yield _on(pictures[number], source, _showing(document, shown), folder)


def on_pictures_read(source: Source, document: Document, folder: Path, count: int) -> Iterator[tuple[str, Source]]:
    """A source with its panel drawn on some of its pictures, where it was found in them and its needles were read."""
    pictures = sorted(source.folder.glob(source.pictures))
    decode_source(source, folder / "found")
    flight, alignments = (
        read_table(folder / "found" / name, separator)
        for name, separator in (("flight.csv", ","), ("flight_alignment.tsv", "\t"))
    )
    names = [needle["name"] for gauge in document["gauges"] for needle in gauge["needles"]]
    read = np.all([np.array(flight.columns[f"{name}_status"]) == "read" for name in names], axis=0)
    clear = np.flatnonzero(read)
    for number in sorted(spread(len(clear), count)):
        row = int(clear[number])
        there = np.array(alignments.columns["matrix"][row].split(), float).reshape(3, 3)
        shown = {name: float(flight.columns[name][row]) for name in names}
        yield _on(pictures[row], source, _moved(_showing(document, shown), there), folder)


def _on(picture: Path, source: Source, drawn: Document, folder: Path) -> tuple[str, Source]:
    """A source whose panel is drawn on one of its pictures."""
    on = replace(source, panel_picture=str(picture.relative_to(source.folder)))
    path = folder / f"{picture.stem}.yaml"
    return f"on {picture.stem}", _written(on, {**drawn, "picture": f"{picture.stem}.jpg"}, path)


def _showing(document: Document, values: Mapping[str, float]) -> Document:
    """A panel with its needles and cards as they are at these values."""
    return {**document, "gauges": [_seen(gauge, values) for gauge in document["gauges"]]}


def _moved(document: Document, there: Floats) -> Document:
    """A panel of dials where a picture shows it that is moved, turned and scaled by a matrix."""
    turn = float(np.degrees(np.arctan2(there[1, 0] - there[0, 1], there[0, 0] + there[1, 1])))
    scale = float(np.sqrt(np.linalg.det(there[:2, :2])))

    def point(x: float, y: float) -> list[float]:
        x, y, depth = there @ (x, y, 1.0)
        return [float(x / depth), float(y / depth)]

    def anchor(own: Document) -> Document:
        x, y, width, height = own["box"]
        middle_x, middle_y = point(x + width / 2, y + height / 2)
        return {**own, "box": [round(middle_x - width / 2), round(middle_y - height / 2), width, height]}

    def turned(own: Document) -> Document:
        moved = {**own}
        if "scale" in own:
            moved["scale"] = [[angle + turn, value] for angle, value in own["scale"]]
        if "template" in own:
            moved["template"] = {**own["template"], "at": own["template"]["at"] + turn}
        return moved

    def gauge(own: Document) -> Document:
        start, end = own["sweep"]
        return {
            **turned(own),
            "centre": point(*own["centre"]),
            "radius": [scale * radius for radius in own["radius"]],
            "sweep": [start + turn, start + turn + (end - start)],
            "needles": [turned(needle) for needle in own["needles"]],
        }

    return {
        **document,
        "anchors": [anchor(own) for own in document["anchors"]],
        "gauges": [gauge(own) for own in document["gauges"]],
    }


def _seen(gauge: Document, truth: Mapping[str, float]) -> Document:
    """A gauge with its needles cut where they stand in a picture, or its card as it is turned there."""
    if "card" in gauge:
        turn = _angle(gauge["scale"], gauge.get("wraps"), truth[gauge["card"]["name"]]) - gauge["card"]["index"]
        gauge = {**gauge, "scale": [[angle - turn, value] for angle, value in gauge["scale"]]}
    if "needles" not in gauge:
        return gauge
    whole = truth.get(gauge.get("combined", {}).get("name", ""))
    needles = []
    for needle in gauge["needles"]:
        scale, wraps = needle.get("scale", gauge["scale"]), needle.get("wraps", gauge.get("wraps"))
        value = truth[needle["name"]] if whole is None else whole
        at = _angle(scale, wraps, value)
        needles.append({**needle, "template": {**needle["template"], "at": round(float(at), 1)}})
    return {**gauge, "needles": needles}


def _angle(scale: Sequence[Sequence[float]], wraps: float | None, value: float) -> float:
    marks = tuple((float(angle), float(each)) for angle, each in scale)
    return float(Scale.of(marks, wraps).angles_of(np.array([value]))[0])


def _written(source: Source, document: Document, path: Path) -> Source:
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return replace(source, panel=path)


def measure(source: Source) -> Iterator[Drawn]:
    """Every manner of drawing a source's panel, one after the other."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for number, (manner, drawn) in enumerate(manners(source, folder)):
            try:
                found = reads(decode_source(drawn, folder / str(number)))
            except SystemExit:  # refused, and why stands on stderr
                found = []
            yield Drawn(source.title, manner, found)


def row(drawn: Drawn) -> tuple[str, ...]:
    """What it costs, over all needles: a needle's row holds if its intervals hold in 90 % of its values."""
    if not drawn.reads:
        return (drawn.title, drawn.manner, "refused", *[""] * (len(HEADER) - 3))
    valued, read, within, mean = (
        np.array([getattr(needle, name) for needle in drawn.reads]) for name in ("valued", "read", "within_95", "mean")
    )
    return (
        drawn.title,
        drawn.manner,
        str(len(drawn.reads)),
        f"{valued.mean():.1%}",
        f"{read.mean():.1%}",
        str(sum(needle.gross for needle in drawn.reads)),
        f"{np.nanmean(within):.0%}",
        f"{(within >= HOLDS).sum()} of {len(within)}",
        f"{np.nanmean(mean):.3f}",
    )


def main(titles: Sequence[str]) -> None:
    """Print a table of all sources, or of those whose titles hold one of the words."""
    rows = [
        row(drawn)
        for source in available()
        if not titles or any(word in source.title for word in titles)
        for drawn in measure(source)
    ]
    sys.stdout.write(text_table(HEADER, rows) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
