"""The table of all kinds of instrument.

All code that reads, learns or draws gets a gauge's kind here, and uses only that. A new kind is a module in `kinds`, a
line in `KINDS`, and its part of the schema in `decoder.panel.gauge`.
"""

from __future__ import annotations

from decoder.instruments.kind import Kind
from decoder.instruments.kinds.dials.attitude import AttitudeKind
from decoder.instruments.kinds.dials.ball import BallKind
from decoder.instruments.kinds.dials.card import CardKind
from decoder.instruments.kinds.dials.needle_dials import GearedKind, NeedleKind, StackKind
from decoder.instruments.kinds.dials.over_card import OverCardKind
from decoder.instruments.kinds.windows.digits import DigitsKind
from decoder.instruments.kinds.windows.lamp import LampKind
from decoder.instruments.kinds.windows.linear import LinearKind
from decoder.instruments.kinds.windows.printed import PrintedKind
from decoder.instruments.kinds.windows.tape import TapeKind
from decoder.panel.gauge import Gauge

_NEEDLES: tuple[Kind, ...] = (NeedleKind(), GearedKind(), StackKind())
KINDS: tuple[Kind, ...] = (
    *_NEEDLES,
    CardKind(),
    AttitudeKind(),
    OverCardKind(_NEEDLES),
    BallKind(_NEEDLES[0]),
    LampKind(),
    LinearKind(),
    TapeKind(),
    DigitsKind(),
    PrintedKind(),
)


def kind_of(gauge: Gauge) -> Kind:
    """Return the kind of a gauge."""
    return next(kind for kind in KINDS if kind.owns(gauge))
