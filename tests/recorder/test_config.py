"""recorder.yaml: what is right is taken, what is wrong is named with its full path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from camera_drivers.qx10.options import Limits
from recorder.config import load_config, parse_config
from recorder.errors import ConfigurationError
from recorder.settings import Qx10Limits, Qx10Settings, RecorderConfig, ReplaySettings


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
    """All that the design names, and a number where the camera wants a word."""
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
                "iso_speed_rate": 400,
                "still_size": ["4:3", "18M"],
                "limits": {"shot_s": 120},
            },
            "storage": {"directory": "/var/lib/recorder"},
        }
    )

    assert isinstance(config.camera, Qx10Settings)
    assert config.camera.iso_speed_rate == "400"
    assert config.camera.still_size == ("4:3", "18M")
    assert (config.camera.limits.shot_s, config.camera.limits.call_s) == (120, 10)
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


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"url": "10.0.0.1"}, r"camera\.url: value error, it is no http URL, got '10\.0\.0\.1'"),
        ({"exposure_compensation": 7}, r"camera\.exposure_compensation: .*, got 7"),
        ({"zoom": "far"}, r"camera\.zoom"),
        ({"limits": {"shot": 1}}, r"camera\.limits\.shot: there is no such setting"),
        ({"limits": {"call_s": 0}}, r"camera\.limits\.call_s: input should be greater than 0, got 0"),
    ],
)
def test_wrong_setting_of_a_camera_is_named(tmp_path: Path, settings: dict[str, Any], sentence: str) -> None:
    """As every other wrong value."""
    document = {"camera": {"driver": "qx10", **settings}, "storage": {"directory": str(tmp_path)}}
    with pytest.raises(ConfigurationError, match=sentence):
        parse_config(document)


def test_limits_of_the_configuration_are_those_of_the_driver() -> None:
    """What a person can write and what the driver does without it never differ."""
    own = Qx10Limits().model_dump()
    assert own.pop("picture_mib") * 2**20 == Limits().picture_bytes
    assert own == {name: getattr(Limits(), name) for name in own}
    assert len(own) == len(fields(Limits)) - 1
