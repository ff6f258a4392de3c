"""How right the engine's speed by its sound is: the table of docs/sound.md.

Run it with `python -m benchmarks.engine_sound`.
"""

from __future__ import annotations

import numpy as np

from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.timeseries.engine_sound import SpeedStatus, engine_speed
from tests.engines import HARDER, HEARD, peaks_of, sounding, truth_of

SEEDS = range(10, 14)  # others than the tests have
RIGHT_PART = 0.005
CASES = {**HEARD, **HARDER}


def row(name: str) -> str:
    """Measure one of the cases, over some engines drawn at random."""
    known, rpm, surroundings = CASES[name]
    errors, ratios, without = [], [], []
    for seed in SEEDS:
        speed = engine_speed(peaks_of(surroundings(*sounding(known, rpm, seed))), known)
        read, truth = speed.has(SpeedStatus.READ), truth_of(speed, rpm)
        errors.append((speed.rpm / truth - 1)[read])
        ratios.append(((speed.rpm - truth) / speed.sigma)[read])
        without.append(~read)
    error, ratio = np.abs(np.concatenate(errors)), np.abs(np.concatenate(ratios))
    if not error.size:
        return f"| {name} | - | - | 100.0% |"
    right, held = (error < RIGHT_PART).mean(), (ratio < CONFIDENCE_SIGMAS).mean()
    return f"| {name} | {right:.1%}, worst {error.max():.2%} | {held:.1%} | {np.concatenate(without).mean():.1%} |"


def main() -> None:
    """Print the table."""
    for name in CASES:
        print(row(name), flush=True)


if __name__ == "__main__":
    main()
