"""The measurement of reliability detects losses: otherwise its table would be meaningless."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from benchmarks.recorders import Box, eventually, kept, make_pictures
from flight_file.signature import load_signer, make_key_files
from flight_file.verification import Verdict

ENOUGH = 25


@pytest.fixture
def pictures(tmp_path: Path) -> list[bytes]:
    """More than are recorded."""
    return make_pictures(tmp_path / "pictures", 2000)


@pytest.fixture
def recorded(tmp_path: Path, pictures: Sequence[bytes]) -> Box:  # noqa: ARG001 - it is there before
    """A recorder with a key that has recorded some segments."""
    make_key_files(tmp_path / "recorder.key")
    config = tmp_path / "recorder.yaml"
    camera = {"driver": "replay", "path": "pictures", "rate_hz": 50, "pace": "realtime"}
    storage = {"directory": "flights", "segment_s": 0.2, "keep_free_gib": 0}
    document = {"camera": camera, "storage": storage, "evidence": {"key": "recorder.key"}}
    config.write_text(json.dumps(document), encoding="utf-8")
    box = Box(config)
    try:
        eventually(lambda: box.said_stored() >= ENOUGH)
        box.stop()
    finally:
        box.kill()
    return box


@pytest.mark.slow
@pytest.mark.untraced
def test_everything_is_there_until_a_segment_is_deleted(
    recorded: Box, pictures: Sequence[bytes], tmp_path: Path
) -> None:
    """As many frames are lost then as were in it, and the verdict says so too."""
    signer = load_signer(tmp_path / "recorder.key")
    whole = kept(recorded, pictures, signer)
    wrong = kept(recorded, [b"another picture"] * len(pictures), signer)
    recorded.finished()[1].unlink()
    less = kept(recorded, pictures, signer)
    of_the_first = kept(recorded, pictures, signer, said=ENOUGH)

    assert (whole.lost, whole.faults, whole.verdict) == (0, (), Verdict.FITS)
    assert whole.said == whole.found >= ENOUGH
    assert wrong.lost == wrong.said
    assert "byte for byte" in wrong.faults[0]
    assert less.lost == whole.found - less.found > 0
    assert less.faults
    assert of_the_first.lost > 0
