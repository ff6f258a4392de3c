"""recorder.yaml: what is right is taken, what is wrong is named with its full path."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from recorder.config import RecorderConfig, ReplaySettings, load_config, parse_config
from recorder.errors import ConfigurationError


def test_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    """Wherever the recorder is started, a relative path means the same."""
    path = tmp_path / "recorder.yaml"
    content = b"""
camera: {driver: replay, path: [one.mcap, /two.mcap]}
storage: {directory: flights}
attach: {panel: p/panel.yaml}
"""
    path.write_bytes(content)
    config, configuration = load_config(path)

    assert isinstance(config.camera, ReplaySettings)
    assert config.camera.paths == [tmp_path / "one.mcap", Path("/two.mcap")]
    assert config.storage.directory == tmp_path / "flights"
    assert config.attach.panel == tmp_path / "p/panel.yaml"
    assert configuration == content


def test_defaults_are_the_documented_ones(configure: Callable[..., RecorderConfig]) -> None:
    """One minute a segment, two GiB and five hours kept, realtime pace."""
    storage = configure().storage

    assert (storage.segment_s, storage.keep_free_gib, storage.keep_hours) == (60, 2, 5)
    assert ReplaySettings(driver="replay", path=Path("x")).pace == "realtime"


def test_documented_qx10_configuration_is_valid(configure: Callable[..., RecorderConfig]) -> None:
    """The camera's block is checked already, though its driver is not part of this version."""
    config = parse_config(
        {
            "camera": {
                "driver": "qx10",
                "url": "http://10.0.0.1:64321/DmsRmtDesc.xml",
                "interface": "wlan0",
                "mode": "stills",
                "interval_s": 2.0,
                "picture": "Original",
                "zoom": 12.5,
                "exposure_compensation": 0,
            },
            "storage": {"directory": "/var/lib/recorder"},
        }
    )

    assert config.camera.driver == "qx10"
    assert configure().camera.driver == "replay"


@pytest.mark.parametrize(
    ("blocks", "sentence"),
    [
        ({"storage": {"segment_s": 0}}, r"storage\.segment_s: input should be greater than 0, got 0"),
        ({"storage": {"segment": 60}}, r"storage\.segment: there is no such setting"),
        ({"storage": {"directory": 7}}, r"storage\.directory: .*, got 7"),
        ({"camera": {"rate_hz": "fast"}}, r"camera\.rate_hz: .*, got 'fast'"),
        ({"camera": {"pace": "slow"}}, r"camera\.pace: .*'realtime' or 'fastest'"),
        ({"camera": {"driver": "leica"}}, r"camera: .*'leica'"),
        ({"camera": {"interval_s": 1}}, r"camera\.interval_s: there is no such setting"),
        ({"attach": {"pannel": "x"}}, r"attach\.pannel: there is no such setting"),
    ],
)
def test_wrong_value_is_named_with_its_path(
    configure: Callable[..., RecorderConfig], blocks: dict[str, Any], sentence: str
) -> None:
    """One sentence: where, what is wrong, what was given."""
    with pytest.raises(ConfigurationError, match=sentence) as caught:
        configure(**blocks)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "the whole file: "),
        (b"camera: [", "line 1 is not YAML"),
        (b"camera: \xff\xfe", "is not YAML"),
        (b"- 1\n- 2\n", "the whole file: "),
        (b"camera: {driver: replay, path: x}\n", "storage: is missing"),
    ],
)
def test_file_that_is_no_configuration_is_one_sentence(tmp_path: Path, content: bytes, sentence: str) -> None:
    """An empty file, broken YAML, no text, a list, half a configuration."""
    path = tmp_path / "recorder.yaml"
    path.write_bytes(content)

    with pytest.raises(ConfigurationError, match=sentence) as caught:
        load_config(path)
    assert str(caught.value).startswith(str(path))


def test_missing_file_is_one_sentence(tmp_path: Path) -> None:
    """A configuration that is not there says so."""
    with pytest.raises(ConfigurationError, match="check its name"):
        load_config(tmp_path / "recorder.yaml")
