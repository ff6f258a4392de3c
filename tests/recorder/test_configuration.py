"""recorder.yaml and the files it names: what is right is taken, what is wrong is named in one sentence."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel

from camera_drivers.camera import CameraIdentity
from camera_drivers.errors import CameraError
from camera_drivers.picamera.options import PicameraSettings
from camera_drivers.qx10.options import Qx10Settings
from camera_drivers.replay.options import ReplaySettings
from camera_drivers.reporter import Reporter
from camera_drivers.rtsp.options import RtspSettings
from camera_drivers.uvc.options import UvcSettings
from recorder.capture import wire
from recorder.config import AttachSettings, EvidenceSettings, StorageSettings, load_config, parse_config
from recorder.errors import ConfigurationError
from recorder.frame_queue import Drops, FrameQueue
from recorder.host import SimulatedClock, fixed_host
from recorder.journal import Journal
from recorder.plan import configured_signer, gather_attachments
from recorder.run import Assembly, record

PANEL = """
name: x
picture: panel.jpg
gauges:
  - needles:
      - {name: a, template: {at: 214.0, span: 14}}
      - {name: b, template: {picture: needles/fr.png}}
"""
REPLAY = "camera: {driver: replay, path: pictures, "
QX10 = "camera: {driver: qx10, "
ANYTHING = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.integers(10**300, 10**310)
    | st.floats()
    | st.sampled_from([1e308, 5e-324, -0.0, "a\0b", "a\nb", "", ".", "/", "//", "x" * 5000, "http://a..b/", "\u2028"])
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=20),
    lambda part: st.lists(part, max_size=3) | st.dictionaries(st.text(max_size=3), part, max_size=3),
    max_leaves=6,
)
CAMERA = "camera: {driver: replay, path: pictures, rate_hz: 4, pace: fastest}\n"
STORAGE = "storage: {directory: flights}\n"
BOMB = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 40))


def test_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    """Wherever the recorder is started, a relative path means the same; a date is a name like any other."""
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
    path.write_text(CAMERA + "storage: {directory: 2018-13-45}")
    assert load_config(path)[0].storage.directory == tmp_path / "2018-13-45"


def test_panel_brings_the_pictures_it_names(tmp_path: Path) -> None:
    """Every `picture` at any depth is attached under the name that the panel uses for it."""
    (tmp_path / "panel.yaml").write_text(PANEL)
    (tmp_path / "panel.jpg").write_bytes(b"1")
    (tmp_path / "needles").mkdir()
    (tmp_path / "needles/fr.png").write_bytes(b"2")
    (tmp_path / "lens.yaml").write_bytes(b"3")
    settings = AttachSettings(panel=tmp_path / "panel.yaml", camera=tmp_path / "lens.yaml")

    assert gather_attachments(settings, b"4") == {
        "panel.yaml": PANEL.encode(),
        "panel.jpg": b"1",
        "needles/fr.png": b"2",
        "camera.yaml": b"3",
        "recorder.yaml": b"4",
    }


@pytest.mark.parametrize(
    ("panel", "sentence"),
    [
        ("picture: ../secret.jpg", "must lie in the panel's folder"),
        ("picture: /etc/passwd", "must lie in the panel's folder"),
        ("picture: camera.yaml", "must lie in the panel's folder"),
        ("picture: gone.jpg", r"attach\.panel: .*gone\.jpg cannot be read"),
        ("picture: [", "is not YAML"),
    ],
)
def test_panel_that_cannot_travel_is_one_sentence(tmp_path: Path, panel: str, sentence: str) -> None:
    """Pictures outside of the panel's folder, missing ones, and a panel that is no YAML."""
    path = tmp_path / "panel.yaml"
    path.write_text(panel)

    with pytest.raises(ConfigurationError, match=sentence):
        gather_attachments(AttachSettings(panel=path), b"")


class Nobody:
    """Hears what a camera says beside its pictures."""

    def __getattr__(self, _name: str) -> Any:  # noqa: ANN401 - any of the reporter's
        return lambda *_arguments: None


def keys(model: type[BaseModel]) -> st.SearchStrategy[str]:
    """One of the keys of a part of the configuration."""
    return st.sampled_from(sorted(set(model.model_fields) - {"driver", "limits"}))


LIVE: dict[str, tuple[type[BaseModel], dict[str, str]]] = {
    "qx10": (Qx10Settings, {}),
    "uvc": (UvcSettings, {"device": "/dev/video0"}),
    "picamera": (PicameraSettings, {}),
    "rtsp": (RtspSettings, {"url": "rtsp://10.0.0.1/"}),
}


def changes(name: str, model: type[BaseModel], needed: dict[str, str]) -> st.SearchStrategy[dict[str, Any]]:
    """Settings of a driver, some of them with any values."""
    changed = st.dictionaries(keys(model), ANYTHING, max_size=2)
    return changed.map(lambda found: {"driver": name, **needed, **found})


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    camera=st.dictionaries(keys(ReplaySettings), ANYTHING, max_size=2)
    | st.sampled_from(sorted(LIVE)).flatmap(lambda name: changes(name, *LIVE[name])),
    storage=st.dictionaries(keys(StorageSettings), ANYTHING, max_size=2),
    attach=st.dictionaries(st.sampled_from(["panel", "camera"]), ANYTHING, max_size=2),
    evidence=st.dictionaries(keys(EvidenceSettings), ANYTHING, max_size=1),
)
def test_any_value_of_any_key_is_taken_or_refused_in_a_sentence(
    document: dict[str, Any],
    tmp_path: Path,
    camera: dict[str, Any],
    storage: dict[str, Any],
    attach: dict[str, Any],
    evidence: dict[str, Any],
) -> None:
    """Up to where the camera would be touched: everything that the configuration decides is decided."""
    changed = {
        "camera": camera if "driver" in camera else {**document["camera"], **camera},
        "storage": {**document["storage"], **storage},
        "attach": attach,
        "evidence": evidence,
    }
    host = fixed_host(SimulatedClock(0))
    reporter: Reporter = Nobody()
    try:
        config = parse_config(changed, base=tmp_path)
        gather_attachments(config.attach, b"")
        signer = configured_signer(config.evidence)
        wiring = wire(config, host, reporter)
    except (ConfigurationError, CameraError) as error:
        assert "\n" not in str(error)  # noqa: PT017 - both ends are right
        assert len(str(error)) < 8000  # noqa: PT017
        return
    assembly = Assembly(
        config=config, host=host, wiring=wiring, journal=Journal(), drops=Drops(), queue=FrameQueue(), signer=signer
    )
    store = assembly.store(attachments={}, name=None, salvager=None)
    store.make_room()
    assert isinstance(wiring.camera.identity, CameraIdentity)


def write(path: Path, content: str | bytes) -> Path:
    """A file with this in it."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "the whole file: "),
        ("camera: [", "line 1 is not YAML"),
        (b"camera: \xff", "is not YAML"),
        ("- 1\n- 2\n", "the whole file: "),
        (CAMERA, "storage: is missing"),
        (CAMERA + "storage: {directory: 7}", "storage.directory: "),
        (CAMERA + "storage: {directory: a, segment: 60}", "storage.segment: there is no such setting"),
        (CAMERA + "storage: {directory: a, segment_s: 0}", "storage.segment_s: input should be greater than 0, got 0"),
        (REPLAY + "rate_hz: fast}\n" + STORAGE, "camera.rate_hz: "),
        (REPLAY + "pace: slow}\n" + STORAGE, "'realtime' or 'fastest'"),
        (REPLAY + "interval_s: 1}\n" + STORAGE, "camera.interval_s: there is no such setting"),
        ("camera: {driver: leica}\n" + STORAGE, "'leica'"),
        (
            QX10 + "url: 'http://[fe80::1%wlan0]:64321/DmsRmtDesc.xml'}\n" + STORAGE,
            "camera.url: value error, it has an IPv6",
        ),
        (QX10 + "url: 10.0.0.1}\n" + STORAGE, "camera.url: value error, it is no http URL, got '10.0.0.1'"),
        (
            "camera: {driver: rtsp, url: 'rtsp://crew:pass@10.0.0.1/'}\n" + STORAGE,
            "camera.url: value error, it holds a user or password, which every flight would carry; put them into",
        ),
        ("camera: {driver: rtsp, url: [pass]}\n" + STORAGE, "camera.url: value error, it is no rtsp URL."),
        ("camera: {driver: uvc, device: video0}\n" + STORAGE, "camera.device: string should match pattern '^/dev/'"),
        ("camera: {driver: uvc, device: /dev/video0, size_px: [640]}\n" + STORAGE, "camera.size_px.1: is missing"),
        ("camera: {driver: picamera, codec: h264, interval_s: 2}\n" + STORAGE, "interval_s is for mjpeg"),
        (QX10 + "exposure_compensation: 7}\n" + STORAGE, "camera.exposure_compensation: "),
        (QX10 + "zoom: far}\n" + STORAGE, "yaml: camera.zoom: input should be 'wide', 'tele' or 'leave', got 'far'"),
        ("camera: {driver: replay, path: }\n" + STORAGE, "yaml: camera.path: it is no path, got None"),
        ("camera: {driver: replay, path: [a, 5]}\n" + STORAGE, "; camera.path.1: it is no path, got 5."),
        ("camera: {driver: replay, path: ~/x}\n" + STORAGE, "yaml: camera.path: value error, ~ is no home here"),
        (QX10 + "limits: {shot: 1}}\n" + STORAGE, "camera.limits.shot: there is no such setting"),
        (
            QX10 + "limits: {picture_mib: 257}}\n" + STORAGE,
            "camera.limits.picture_mib: input should be less than or equal",
        ),
        (QX10 + "limits: {call_s: 0}}\n" + STORAGE, "camera.limits.call_s: input should be greater than 0, got 0"),
        (CAMERA + STORAGE + "attach: {pannel: x}", "attach.pannel: there is no such setting"),
        (CAMERA + "storage: {directory: flights, keep_hours: .inf}", "keep_hours"),
        (CAMERA + "storage: {directory: flights, keep_free_gib: 1.0e+308}", "keep_free_gib"),
        (CAMERA + "storage: {directory: flights, segment_s: .nan}", "segment_s"),
        (CAMERA + "storage: {directory: flights, keep_hours: 5, max_hours: 4}", "must not be less than keep_hours"),
        (CAMERA + "storage: {directory: flights, keep_hours: off}", "keep_hours: input should be a valid number"),
        (
            CAMERA + "storage: {directory: flights, keep_hours: false}",
            "storage: value error, keep_hours is true",
        ),
        (CAMERA + "storage: {directory: flights, keep_hours: 1:30}", "keep_hours: input should be a valid number"),
        (CAMERA + "storage: {directory: flights, segment_frames: 0100}", "0100 is octal; write it without the 0"),
        (CAMERA + 'storage: {directory: "a\\0b"}', "storage.directory"),
        (
            CAMERA + "storage: {directory: ~/flights}",
            "storage.directory: value error, ~ is no home here; write the whole",
        ),
        (CAMERA + "storage: {directory: " + "x" * 300 + "}", "storage.directory"),
        (CAMERA + "storage: {directory: pictures/000.jpg}", "000.jpg is no directory; name one where"),
        (CAMERA + "storage: {directory: pictures/000.jpg/a/b}", "pictures/000.jpg, on the way there, is none; name"),
        (CAMERA + "storage: {directory: circle}", "circle cannot be a directory: it is a link that leads in a circle;"),
        (CAMERA + "storage: {directory: circle/a}", "circle, on the way there, is a link that leads in a circle; name"),
        (CAMERA + STORAGE + "attach: {panel: /dev/zero}", "attach.panel"),
        (CAMERA + STORAGE + "attach: {camera: pictures}", "attach.camera"),
        (CAMERA + STORAGE + "attach: {panel: bomb.yaml}", "bomb.yaml"),
        (CAMERA + STORAGE + "attach: {panel: null_picture.yaml}", "must lie in the panel's folder"),
        (CAMERA + STORAGE + "evidence: {key: pictures}", "evidence.key"),
        (CAMERA + STORAGE + "evidence: {key: fifo}", "evidence.key"),
        (b"#" * 2**21, "recorder.yaml"),
    ],
    ids=lambda value: repr(value[-40:]),
)
def test_wrong_configuration_is_one_sentence(
    tmp_path: Path, pictures: Path, content: str | bytes, sentence: str
) -> None:
    """Nothing is recorded, nothing is waited for, and no traceback is seen."""
    assert pictures.is_dir()
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "circle").symlink_to("round")
    (tmp_path / "round").symlink_to("circle")
    write(tmp_path / "bomb.yaml", BOMB)
    write(tmp_path / "null_picture.yaml", 'picture: "a\\0b"')
    path = write(tmp_path / "recorder.yaml", content)
    with pytest.raises(ConfigurationError) as caught:
        start(path)
    assert sentence in str(caught.value)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "flights").exists()


def test_values_are_what_they_look_like(tmp_path: Path) -> None:
    """The camera's own words need no quotes, though older YAML takes them for something else."""
    path = write(
        tmp_path / "recorder.yaml", QX10 + "beep_mode: Off, still_size: [4:3, 18M], set_clock: no}\n" + STORAGE
    )
    camera = load_config(path)[0].camera

    assert isinstance(camera, Qx10Settings)
    assert (camera.beep_mode, camera.still_size, camera.set_clock) == ("Off", ("4:3", "18M"), False)


def start(path: Path) -> None:
    """Record as the command does, in this process."""
    config, configuration = load_config(path)
    record(config, host=fixed_host(SimulatedClock(0)), journal=Journal(io.StringIO()), configuration=configuration)


@pytest.mark.parametrize("file", ["/dev/zero", "fifo", ".", "none"])
def test_configuration_that_is_no_file_is_one_sentence(tmp_path: Path, file: str) -> None:
    """It is not waited for."""
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(ConfigurationError) as caught:
        start(tmp_path / file)
    assert str(caught.value).startswith(str(tmp_path / file))
    assert "\n" not in str(caught.value)
