"""A round dial with needles over it: drawn for any positions of the needles, and compared with a frame.

Rows go once around the dial, columns outward from its centre, so each pixel occurs once. A needle with a tail is two
layers, half a turn apart. Needles are drawn from the lowest up, each added to what lies behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.thresholds import MIN_LIGHT_GAIN
from decoder.panel.arrays import Floats, Indices
from decoder.registration.thresholds import NOISE_LEVELS


@dataclass(frozen=True, slots=True)
class _Layer:
    """A needle or its tail: light and transparency around a row `behind_rows` behind the tip's.

    Attributes
    ----------
    pixels, rises
        (H + 1, 2, C): each row, and its difference to the next; the last row draws nothing.
    """

    pixels: Floats
    rises: Floats
    behind_rows: float

    @classmethod
    def of(cls, pixels: Floats, behind_rows: float) -> _Layer:
        """Lay out pixels (H, 2, C)."""
        nothing = np.broadcast_to(np.array([[0.0], [1.0]], np.float32), (1, *pixels.shape[1:]))
        rises = np.concatenate([np.diff(pixels, axis=0), np.zeros((2, *pixels.shape[1:]), np.float32)])
        return cls(np.concatenate([pixels, nothing]), rises, behind_rows)

    @property
    def shadow(self) -> _Layer:
        """The same without light."""
        dark = np.array([[0.0], [1.0]], np.float32)
        return _Layer(self.pixels * dark, self.rises * dark, self.behind_rows)


class LayeredDial:
    """Draws K needles over a face.

    Parameters
    ----------
    face
        (N, C) float32: once around.
    templates
        The lowest needle first; those with tails have more columns than the face, the tail's first.
    step
        Only every `step`-th row and column of the dial is drawn; N is a multiple of it.
    """

    def __init__(self, face: Floats, templates: Sequence[NeedleTemplate], step: int = 1) -> None:
        self._step = step
        self.face = np.ascontiguousarray(self.thinned(face))
        self._layers = [_layers_of(template, face.shape, step) for template in templates]

    def thinned(self, dials: Floats) -> Floats:
        """(..., N', C'): the rows and columns of dials (..., N, C) that are drawn."""
        thin: Floats = dials[..., :: self._step, :: self._step]
        return thin

    def drawn(self, rows: Floats, needles: Sequence[int] | None = None) -> Floats:
        """(M, N', C') float32: the dial with all or some of its needles on rows (M, K); NaN leaves a needle out."""
        pictures = np.repeat(self.face[None], len(rows), axis=0)
        for needle in range(len(self._layers)) if needles is None else needles:
            there = np.flatnonzero(np.isfinite(rows[:, needle]))
            for layer in self._layers[needle]:
                self._draw(pictures, there, layer, rows[there, needle] + layer.behind_rows)
        return pictures

    def left_bare(self, rows: Floats, needles: Sequence[int]) -> Floats:
        """(M, N', C') float32: how much of what lies behind some of the needles shows through them."""
        through, every = np.ones((len(rows), *self.face.shape), np.float32), np.arange(len(rows))
        for needle in needles:
            for layer in self._layers[needle]:
                self._draw(through, every, layer.shadow, rows[:, needle] + layer.behind_rows)
        return through

    def _draw(self, pictures: Floats, which: Indices, layer: _Layer, rows: Floats) -> None:
        """Draw a layer on some of the pictures, around a row of its own on each."""
        nothing = len(layer.pixels) - 1
        last, axis = nothing - 1, (nothing - 1) // 2
        first = np.ceil((rows - axis) / self._step)
        at = (first * self._step - rows + axis)[:, None] + self._step * np.arange(last // self._step + 1)
        before = np.where(at <= last, at, nothing).astype(np.intp)
        own = layer.rises.take(before, axis=0)
        own *= (at - before).astype(np.float32)[..., None, None]
        own += layer.pixels.take(before, axis=0)
        turn, columns = self.face.shape
        there = which[:, None] * turn + (first.astype(np.intp)[:, None] + np.arange(at.shape[1])) % turn
        lines = pictures.reshape(-1, columns)
        drawn = lines.take(there, axis=0)
        drawn *= own[..., 1, :]
        drawn += own[..., 0, :]
        lines[there] = drawn


def _layers_of(template: NeedleTemplate, shape: tuple[int, ...], step: int) -> list[_Layer]:
    turn, columns = shape
    tail = template.light.shape[1] - columns
    halves = [(slice(tail, None), 0.0), *([(slice(tail - 1, None, -1), turn / 2)] if tail else [])]
    return [
        _Layer.of(np.stack([template.light[:, own], template.transparency[:, own]], axis=1)[..., ::step], behind_rows)
        for own, behind_rows in halves
    ]


def axis_of(template: NeedleTemplate, face: Floats) -> Floats:
    """(C,): what a needle adds along its axis to the median of a face (N, C), in grey levels."""
    own = slice(-face.shape[1], None)
    middle = (template.rows - 1) // 2
    added: Floats = template.light[middle, own] + (template.transparency[middle, own] - 1.0) * np.median(face, axis=0)
    return added


class DialComparison:
    """Compares drawings of a dial, (N, C), with frames of it.

    Each pixel of the picture counts once, so samples near the centre, where rows converge, count less. No residual
    counts for more than the contrast of the dimmest needle. Otherwise, where the face below a bright needle is still
    unknown, its large residuals would outweigh a dim needle elsewhere.

    Parameters
    ----------
    face
        (N, C): the dial without needles.
    radii_px
        (C,): how far each column lies from the centre.
    templates
        Of the dial's needles.
    """

    def __init__(self, face: Floats, radii_px: Floats, templates: Sequence[NeedleTemplate]) -> None:
        area = np.tile(np.abs(radii_px), len(face))
        self._shares = (area / area.sum()).astype(np.float32)
        contrasts = (np.abs(axis_of(template, face)) for template in templates)
        dimmest = min(float(np.sqrt(np.mean(each[each >= HALF * each.max()] ** 2))) for each in contrasts)
        self._limit = max(dimmest, 3 * NOISE_LEVELS)

    def lit(self, seen: Floats, drawn: Floats) -> Floats:
        """Bring drawings (..., M, N, C) into the light of (..., N, C), with gain and offset by least squares."""
        off, _ = self._off(seen, drawn)
        return off.reshape(drawn.shape) + seen[..., None, :, :]

    def unexplained(self, seen: Floats, drawn: Floats) -> Floats:
        """Return the mean square residual of drawings (..., M, N, C) in the light of (..., N, C): (..., M)."""
        off, limits = self._off(seen, drawn)
        np.clip(off, -limits, limits, out=off)
        left: Floats = np.vecdot(off * self._shares, off)
        return left

    def times_left(self, seen: Floats, drawn: Floats, levels: Floats) -> Floats:
        """Return the squared residuals of drawings, relative to the squares of some `levels` in their light.

        All are (F, N, C); the result is (F,).
        """
        off, limits = self._off(seen, drawn[:, None])
        np.clip(off, -limits, limits, out=off)
        added = np.clip(levels, -self._limit, self._limit).reshape(len(seen), -1) * (limits[:, 0] / self._limit)
        squares = np.maximum(np.vecdot(added * self._shares, added), 1.0 / self._shares.size)
        left: Floats = np.vecdot(off[:, 0] * self._shares, off[:, 0]) / squares
        return left

    def times_worse(self, seen: Floats, drawn: Floats) -> Floats:
        """Return the ratio of each other drawing's squared residual to the first one's, where the two differ.

        Sensor and JPEG noise is added to both, so the ratio is 1 where two drawings hardly differ.

        Parameters
        ----------
        seen : (..., N, C)
        drawn : (..., M, N, C)

        Returns
        -------
        (..., M - 1)
        """
        off, limits = self._off(seen, drawn)
        first, others, limit = off[..., :1, :], off[..., 1:, :], limits[..., :1, :]
        differ = np.clip(others - first, -limit, limit)
        differ *= differ * self._shares
        noise = NOISE_LEVELS**2 * np.maximum(differ.sum(axis=-1), 1.0 / self._shares.size)
        left, least = (np.vecdot(differ, np.clip(each, -limit, limit) ** 2) for each in (others, first))
        worse: Floats = (left + noise) / (least + noise)
        return worse

    def _off(self, seen: Floats, drawn: Floats) -> tuple[Floats, Floats]:
        """Return the residuals of drawings in the light of what is seen, and the limit of each residual.

        (..., M, N * C) and (..., M, 1), float32.
        """
        levels, off = (each.reshape(*each.shape[:-2], -1) for each in (seen, drawn))
        levels = levels - (levels @ self._shares)[..., None]
        off = off - (off @ self._shares)[..., None]
        weighed = off * self._shares
        power = np.maximum(np.vecdot(weighed, off), 1.0 / self._shares.size)
        shared = np.vecdot(weighed, levels[..., None, :])
        gain = np.maximum(shared / power, MIN_LIGHT_GAIN).astype(np.float32)[..., None]
        off *= gain
        off -= levels[..., None, :]
        return off, gain * np.float32(self._limit)
