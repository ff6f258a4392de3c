"""`python -m benchmarks.disturbances ROWS.csv [--only WORDS] [--by NAME ...]`: strangers' flights in a rougher cockpit.

Frames of a source are disturbed as hands, sun, shade, glass, vibration and a poor camera would; its panel and the
picture on which that is drawn are as they were. The rows are those of `benchmarks.strangers`, one for each column of
flight data, under the name of the disturbance.
"""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from benchmarks.real_pictures import Source, decode_source, reads
from benchmarks.strangers import TOTALS, Row, sources, summary, write
from decoder.outputs.csv_output import text_table
from decoder.panel.arrays import Floats

Disturb = Callable[[Floats, int, np.random.Generator], Floats]
"""A picture (H, W, 3) in grey levels, its number, and chance; gives the disturbed picture."""

NOISE_LEVELS, QUALITY, SEED = 1.5, 88, 100
CLEAN_FRAMES, STEADY_PART = 12, 0.5


def hand(picture: Floats, number: int, _: np.random.Generator) -> Floats:
    """A hand with its arm reaches over the panel, now here, now there."""
    (height, width), at = picture.shape[:2], number / 6
    x, y = width * (0.5 + 0.55 * math.sin(at)), height * (0.35 + 0.3 * math.sin(0.7 * at))
    mask = np.zeros((height, width), np.float32)
    palm, elbow = (round(x), round(y)), (round(0.6 * width), round(1.2 * height))
    cv2.ellipse(mask, palm, (round(0.1 * width), round(0.08 * height)), 20 * math.sin(at), 0, 360, 1.0, -1)
    cv2.line(mask, palm, elbow, 1.0, round(0.09 * width))
    return _over(picture, _soft(mask, 3.0), np.array([70.0, 90.0, 130.0]))


def sun(picture: Floats, number: int, _: np.random.Generator) -> Floats:
    """Three patches of sunlight wander over the panel and saturate what is white."""
    (height, width), at = picture.shape[:2], number / 9
    mask = np.zeros((height, width), np.float32)
    for patch in range(3):
        x = width * (0.2 + 0.3 * patch + 0.12 * math.sin(at + patch))
        y = height * (0.4 + 0.25 * math.sin(0.8 * at + 2 * patch))
        corners = np.array([[-1.0, -0.6], [0.8, -1.0], [1.0, 0.7], [-0.7, 1.0]]) * (0.09 * width, 0.13 * height)
        cv2.fillPoly(mask, [np.rint(corners + np.array([x, y])).astype(np.int32)], 1.0)
    lit = _soft(mask, 1.5)[..., None]
    return np.asarray(picture * (1.0 + 1.4 * lit) + 25.0 * lit)


def shade(picture: Floats, number: int, _: np.random.Generator) -> Floats:
    """Shadows of window posts move across the panel."""
    height, width = picture.shape[:2]
    along = np.arange(width) + 0.4 * np.arange(height)[:, None]
    dark = (np.sin(9.0 * along / width + number / 5) > 0.0).astype(np.float32)
    return np.asarray(picture * (1.0 - 0.65 * _soft(dark, 2.0)[..., None]))


def streaks(picture: Floats, _: int, chance: np.random.Generator) -> Floats:
    """Every other frame is smeared by four to twelve pixels, as in a long exposure."""
    if chance.random() < STEADY_PART:
        return picture
    length, angle, size = chance.uniform(4.0, 12.0), chance.uniform(0.0, math.pi), 25
    steps = np.linspace(-length / 2, length / 2, 8 * size)
    kernel, *_edges = np.histogram2d(
        steps * math.sin(angle), steps * math.cos(angle), bins=size, range=[(-size / 2, size / 2)] * 2
    )
    return np.asarray(cv2.filter2D(picture, -1, kernel / kernel.sum()))


def waves(picture: Floats, _: int, chance: np.random.Generator) -> Floats:
    """A rolling shutter in vibration: rows and columns are shifted by some pixels, in waves."""
    height, width = picture.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    phase = np.float32(chance.uniform(0.0, 2 * math.pi))
    there = x + np.float32(2.5) * np.sin(y / 60 + phase), y + np.float32(1.5) * np.cos(y / 45 + phase)
    return np.asarray(cv2.remap(picture.astype(np.float32), *there, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT))


def exposure(picture: Floats, _: int, chance: np.random.Generator) -> Floats:
    """Exposure, white balance and contrast differ from frame to frame."""
    gain, balance = math.exp(chance.uniform(-1.1, 0.6)), np.exp(chance.normal(0.0, 0.12, 3))
    return np.asarray(255.0 * np.clip(picture / 255.0 * gain * balance, 0.0, 1.0) ** math.exp(chance.normal(0.0, 0.2)))


def pose(picture: Floats, number: int, _: np.random.Generator) -> Floats:
    """The camera rolls by four degrees, zooms by six percent and swings by forty pixels."""
    height, width = picture.shape[:2]
    moved = cv2.getRotationMatrix2D(
        (width / 2, height / 2), 4.0 * math.sin(number / 4), 1.0 + 0.06 * math.sin(number / 5)
    )
    moved[:, 2] += np.array([40.0 * math.sin(number / 3), 30.0 * math.cos(number / 3.7)])
    return np.asarray(cv2.warpAffine(picture, moved, (width, height), borderMode=cv2.BORDER_REFLECT))


def focus(picture: Floats, number: int, _: np.random.Generator) -> Floats:
    """The camera hunts for focus."""
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.3 + 1.6 * (1.0 + math.sin(number / 8))))


def dusk(picture: Floats, _: int, chance: np.random.Generator) -> Floats:
    """A third of the light, and a sensor's noise."""
    return np.asarray(0.35 * picture + chance.normal(0.0, 9.0, picture.shape))


def dirt(picture: Floats, number: int, _: np.random.Generator) -> Floats:
    """From the thirteenth frame on, forty drops lie on the lens."""
    if number < CLEAN_FRAMES:
        return picture
    fixed, mask = np.random.default_rng(5), np.zeros(picture.shape[:2], np.float32)
    for _drop in range(40):
        at = tuple(fixed.integers(0, picture.shape[1::-1]).tolist())
        cv2.circle(mask, at, int(fixed.integers(5, 28)), float(fixed.uniform(0.3, 0.9)), -1)
    return _over(picture, _soft(mask, 4.0), np.full(3, 90.0))


def _over(picture: Floats, mask: Floats, colour: Floats) -> Floats:
    return np.asarray(picture * (1.0 - mask[..., None]) + mask[..., None] * colour)


def _soft(mask: Floats, sigma_px: float) -> Floats:
    return np.asarray(cv2.GaussianBlur(mask, (0, 0), sigma_px), np.float32)


DISTURBANCES: dict[str, Disturb] = {
    each.__name__: each for each in (hand, sun, shade, streaks, waves, exposure, pose, focus, dusk, dirt)
}


def disturbed(source: Source, disturb: Disturb, folder: Path, every: int) -> Source:
    """Write one of so many of a source's pictures disturbed into a folder, beside its panel picture as it is."""
    taken = sorted(source.folder.glob(source.pictures))
    for name in (source.truth, source.panel_picture):
        (folder / "as_it_is" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "as_it_is" / name).symlink_to(source.folder / name)
    (folder / "pictures").mkdir()
    for number, path in enumerate(taken):
        if number % every == 0:
            chance = np.random.default_rng(SEED + number)
            seen = disturb(np.asarray(cv2.imread(str(path)), np.float32), number // every, chance)
            levels = np.clip(seen + chance.normal(0.0, NOISE_LEVELS, seen.shape), 0, 255).astype(np.uint8)
            cv2.imwrite(str(folder / "pictures" / f"{path.stem}.jpg"), levels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        else:
            (folder / "pictures" / f"{path.stem}.jpg").touch()  # so that rows of the truth are counted as before
    return replace(
        source,
        folder=folder,
        pictures="pictures/*.jpg",
        truth=f"as_it_is/{source.truth}",
        panel_picture=f"as_it_is/{source.panel_picture}",
    )


def rows_of(source: Source, names: Sequence[str], every: int) -> Iterator[Row]:
    """A source's rows under each disturbance."""
    for name in names:
        with TemporaryDirectory() as place:
            folder = Path(place)
            rough = disturbed(source, DISTURBANCES[name], folder, every)
            for one in reads(decode_source(rough, folder / "decoded", every=every)):
                yield Row(source.title, name, one.needle, one.valued, one.read, one.gross, one.within_95, one.mean)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, write the rows, and print what they come to, one line for each disturbance."""
    parser = ArgumentParser(prog="python -m benchmarks.disturbances", description=__doc__)
    parser.add_argument("rows", type=Path, metavar="ROWS.csv")
    parser.add_argument("--every", type=int, default=3, help="read one picture of so many (default: %(default)s)")
    parser.add_argument("--only", default="simulator flight, ", metavar="WORDS", help="sources with these words")
    parser.add_argument("--by", nargs="+", choices=DISTURBANCES, default=list(DISTURBANCES), help="disturbances")
    asked = parser.parse_args(arguments)
    rows = write((row for source in sources(asked.only) for row in rows_of(source, asked.by, asked.every)), asked.rows)
    lines = [(name, *summary([row for row in rows if row.manner == name])) for name in asked.by]
    sys.stdout.write(text_table(("disturbed by", *TOTALS), lines) + "\n")


if __name__ == "__main__":
    main()
