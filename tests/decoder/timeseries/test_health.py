"""The verdict on each gauge: drawn well, or what to draw anew and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from decoder.instruments.reading import Status
from decoder.learning.budget import Budget, Cause
from decoder.panel.scale import Combination, Quantity
from decoder.panel.written import BOOLEAN, Written
from decoder.timeseries.flight_data import CODE, FlightData, NeedleSeries
from decoder.timeseries.flight_decoder import decode_flight
from decoder.timeseries.health import doubted, gauge_health
from fixtures.recordings import record_flight
from flight_file.reader import open_flight
from tests.decoder.cockpit import DOCUMENT, PANEL_ANGLES_DEG, angles_of, draw, reader_of
from tests.programs import write_yaml

FRAMES = 12


def decoded(folder: Path, shown: int) -> FlightData:
    """A flight whose first frames show all needles, and the others no speed."""
    pictures = []
    for seed in range(FRAMES):
        hands = angles_of(seed)
        if seed >= shown:
            del hands["speed_kt"]
        pictures.append(folder / f"{seed:02}.jpg")
        cv2.imwrite(str(pictures[-1]), draw(hands, noise=2.0, seed=seed), [cv2.IMWRITE_JPEG_QUALITY, 95])
    write_yaml(folder / "panel.yaml", DOCUMENT)
    cv2.imwrite(str(folder / "panel.png"), draw(PANEL_ANGLES_DEG))
    record_flight(pictures, folder / "panel.yaml", folder / "flight.mcap")
    return decode_flight(open_flight([folder / "flight.mcap"]), reader_of(), lambda frames: frames)


@pytest.mark.parametrize("shown", [FRAMES, 4])
def test_value_that_few_frames_show_is_named(tmp_path: Path, shown: int) -> None:
    """It is named with how often it was read; one that is mostly read is not."""
    data = decoded(tmp_path, shown)
    (speed,) = (series for series in data.series if series.quantity.name == "speed_kt")
    named = [each for found in data.health.values() for each in found if "is read in" in each]

    assert int(speed.has(Status.READ, Status.EDGE).sum()) <= shown
    assert [each.split()[0] for each in named] == (["speed_kt"] if shown < FRAMES else [])
    assert set(data.health) == {gauge["name"] for gauge in DOCUMENT["gauges"]}


def series_of(
    values: Sequence[float], *, wraps: float | None = None, name: str = "a", missing: int = 0
) -> NeedleSeries:
    """A needle that is seen at these values, each to a tenth, but for the last ones."""
    turn = ((0.0, 0.0), (360.0, 100.0))
    quantity = Quantity(name, "dial", "", turn, wraps, None, None)
    status = np.full(len(values), CODE[Status.READ], np.uint8)
    status[len(values) - missing :] = CODE[Status.MISSING]
    shown = np.array(values, float)
    return NeedleSeries(quantity, status, shown, np.full(len(values), 0.1), np.ones(len(values)), shown)


def flight_of(*series: NeedleSeries, combinations: tuple[Combination, ...] = ()) -> FlightData:
    """A flight with these, all frames of which show the panel."""
    frames = np.arange(len(series[0].value))
    return FlightData(frames, frames * 10**9, series, (), combinations)


@pytest.mark.parametrize(
    ("values", "wraps", "moves"),
    [
        ([5.0, 5.1, 4.95], None, False),
        ([5.0, 7.0, 5.0], None, True),
        ([99.95, 0.02, 0.1], 100.0, False),
        ([9.0, *[5.0] * 30], None, False),
        ([*[5.0] * 20, *[5.8] * 10], None, False),
        ([*[5.0] * 30, 7.0, 8.0], None, True),
    ],
)
def test_needle_that_hardly_moves_is_named(values: list[float], wraps: float | None, moves: bool) -> None:  # noqa: FBT001
    """It moves if its values differ by more than their possible errors, the short way round, in more than a few frames.

    A knob that was drawn as a gauge is read at one place, a little beside it where another light falls on it.
    """
    (findings,) = gauge_health(flight_of(series_of(values, wraps=wraps)), {}).values()

    assert [each.split(":")[0] for each in findings] == ([] if moves else ["a hardly moves"])


@pytest.mark.parametrize(("written", "advice"), [(None, "printed behind it"), (BOOLEAN, "shows it plainly")])
def test_what_is_hardly_read_is_told_what_picture_to_draw_it_on(written: Written | None, advice: str) -> None:
    """A lamp or a display has no moving part; only a needle is advised to leave the print."""
    series = series_of([1, 2, 3, 4], missing=3)
    series = replace(series, quantity=replace(series.quantity, written=written))
    ((finding,),) = gauge_health(flight_of(series), {}).values()

    assert finding.endswith(advice)


@pytest.mark.parametrize("alone", [Status.READ, Status.EDGE])
def test_pointers_that_contradict_each_other_are_named(alone: Status) -> None:
    """Each is seen, though it may be an `edge` without the others, but their combined value is not read."""
    parts = [series_of([1, 2, 3, 4], name="fine"), series_of([10, 20, 30, 40], name="coarse")]
    parts = [replace(part, status=np.full_like(part.status, CODE[alone])) for part in parts]
    both = series_of([1, 2, 3, 4], name="both", missing=2)
    combination = Combination(both.quantity, ("fine", "coarse"), 100.0, 0.2)
    (findings,) = gauge_health(flight_of(*parts, both, combinations=(combination,)), {}).values()

    (finding,) = findings
    assert finding.startswith(
        "its pointers contradict each other, or agree by chance, in 2 frames, where both is not read"
    )


@pytest.mark.parametrize("allowed_deg", [0.0, 5.4])
def test_value_that_may_be_off_is_not_read(allowed_deg: float) -> None:
    """Beyond 1 % of full scale or so by its frame or its drawing, whatever is allowed for; value and sigma stay."""
    data = flight_of(series_of([10, 20, 80]), series_of([1, 2, 3], name="exact"))
    off = replace(data.series[0], sigma=np.hypot([0.1, 0.1, 9.0], allowed_deg * 100.0 / 360.0))
    data = replace(data, series=(off, *data.series[1:]))
    told, doubts = doubted(data, lambda name, values: np.full_like(values, allowed_deg if name == "a" else 0.0))
    (a, exact), (before, _) = told.series, data.series

    assert a.status.tolist() == [CODE[Status.READ], CODE[Status.READ], CODE[Status.EDGE]]
    assert (a.value, a.sigma) == (before.value, before.sigma)
    assert exact is data.series[1]
    assert [each.split(":")[0] for each in doubts["dial"]] == ["a is `edge`, not `read`, in 1 frames"]


@pytest.mark.parametrize(
    ("cause", "advice"),
    [
        (Cause.DRAWN, "draw its centre, radius and marks more precisely"),
        (Cause.PIVOT, "its pivot is uncertain"),
        (Cause.PLACED, "box an anchor nearer to it"),
        (Cause.VIEWED, "it is hard to see there"),  # what is only allowed for is no reason
    ],
)
def test_doubt_is_said_with_what_most_of_it_comes_from(cause: Cause, advice: str) -> None:
    """Each cause has a remedy of its own; what none explains is the frame's."""
    data = flight_of(replace(series_of([10, 80]), sigma=np.array([0.1, 5.0])))
    sigmas = {each: np.full(2, 4.0 if each is cause else 0.5) for each in Cause}
    if cause is Cause.VIEWED:
        sigmas[cause] = np.full(2, 0.5)
    data = replace(data, budgets={"a": Budget(np.array([0.0, 100.0]), None, sigmas)})
    (said,) = doubted(data, lambda _, values: np.zeros_like(values))[1]["dial"]

    assert advice in said


@pytest.mark.parametrize("status", [Status.MISSING, Status.INTERPOLATED])
def test_what_was_not_read_is_not_doubted_once_more(status: Status) -> None:
    """Only values claimed as read lose the claim."""
    series = replace(series_of([10, 20]), sigma=np.full(2, 90.0))
    data = flight_of(replace(series, status=np.full(2, CODE[status], np.uint8)))

    assert doubted(data, lambda _, values: np.zeros_like(values)) == (data, {})
