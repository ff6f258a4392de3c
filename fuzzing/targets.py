"""Which commands are fuzzed, and with what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hypothesis import strategies as st

from fuzzing.inputs import (
    Files,
    changed_signed_flights,
    films,
    flights,
    panels_on_a_flight,
    photographs,
    recorder_configurations,
    segments_in_work,
    signatures,
    tables,
)
from fuzzing.judge import Target

_VERIFY = ("recorder", "verify", "--public-key", "in/recorder.key.pub", "in/flight_0000.mcap")
_DECODE = ("--jobs", "1", "-o", "out")


@dataclass(frozen=True, slots=True)
class Fuzzed:
    """A command and what it is given; `weight` is how many inputs it is given where others are given one."""

    target: Target
    files: st.SearchStrategy[Files]
    weight: int = 1


FUZZED: Mapping[str, Fuzzed] = {
    "recorder info": Fuzzed(Target(("recorder", "info", "--json", "in/flight.mcap")), flights(), 6),
    "recorder verify": Fuzzed(Target(("recorder", "verify", "in/flight.mcap"), fails_in_words=False), flights(), 6),
    "signatures": Fuzzed(Target(_VERIFY, fails_in_words=False), signatures(), 3),
    "changed signed flights": Fuzzed(
        Target(_VERIFY, fails_in_words=False, exit_codes=frozenset((1, 3))), changed_signed_flights(), 4
    ),
    "recorder extract": Fuzzed(Target(("recorder", "extract", "in/flight.mcap", "-o", "out")), flights(), 4),
    "recorder recover": Fuzzed(Target(("recorder", "recover", "in/flight.mcap"), writes_beside=True), flights(), 6),
    "recover --key": Fuzzed(
        Target(("recorder", "recover", "--key", "in/recorder.key", "in/flight_0000.mcap.part"), writes_beside=True),
        segments_in_work(),
        4,
    ),
    "recorder run": Fuzzed(
        Target(("recorder", "run", "--config", "in/recorder.yaml"), exit_codes=frozenset((0, 1, 78))),
        recorder_configurations(),
        4,
    ),
    "recorder replay": Fuzzed(Target(("recorder", "replay", "in/flight.mcap", "-o", "out/again.mcap")), flights(), 3),
    "photographs": Fuzzed(
        Target(("recorder", "replay", "in/photographs", "-o", "out/again.mcap", "--rate", "1")), photographs(), 3
    ),
    "films": Fuzzed(Target(("recorder", "replay", "in/film.mp4", "-o", "out/film.mcap", "--keep-sound")), films(), 4),
    "decode rpm": Fuzzed(Target(("decode", "rpm", "in/flight.mcap", "-o", "out/rpm.csv")), flights()),
    "decode": Fuzzed(Target(("decode", "in/flight.mcap", "--format", "csv,mcap", *_DECODE)), flights(), 4),
    "panels": Fuzzed(
        Target(("decode", "in/flight.mcap", "--panel", "in/panel.yaml", *_DECODE)), panels_on_a_flight(), 4
    ),
    "cameras": Fuzzed(
        Target(("decode", "in/flight.mcap", "--panel", "in/panel.yaml", "--camera", "in/camera.yaml", *_DECODE)),
        panels_on_a_flight(),
        2,
    ),
    "decode frames": Fuzzed(Target(("decode", "frames", "in/flight.mcap", "-o", "out")), flights(), 2),
    "decode accuracy": Fuzzed(Target(("decode", "accuracy", "in/flight.csv", "in/truth.csv", "--json")), tables(), 4),
    "truth's clock": Fuzzed(
        Target(("decode", "accuracy", "in/flight.csv", "in/truth.csv", "--offset", "auto", "--limits")), tables(), 3
    ),
    "decode calibrate": Fuzzed(
        Target(
            (
                "decode",
                "calibrate",
                "board",
                "in/photographs/0.jpg",
                "in/photographs/0.jpg",
                "--squares",
                "7x5",
                "-o",
                "out/camera.yaml",
            )
        ),
        photographs(),
    ),
}
