"""What a worker does with a flight: decode it, keep it, or say why not."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from socket import gethostname

import pytest

import decoder
from decoder.panel.errors import PanelError, VersionMismatch
from decoder.parallel.decoding import decode_one
from decoder.parallel.flights import FleetFlight, flight_files, grouped
from decoder.parallel.index import Outcome, State
from decoder.parallel.order import Order, _digest_of_code, make_order
from flight_file.frame import Frame
from tests.fleet.flights import write_flight
from tests.programs import FIXTURES

Results = Callable[[Path], dict[str, bytes]]
MakeOrder = Callable[..., Order]

pytestmark = pytest.mark.xdist_group("fleet")


@pytest.fixture
def order(tmp_path: Path) -> MakeOrder:
    """An order into a folder of the test."""

    def make(*, method: str = "normxcorr", formats: tuple[str, ...] = ("csv",), panel: Path | None = None) -> Order:
        return make_order(
            str(tmp_path / "out"),
            method=method,
            formats=formats,
            with_images=False,
            panel=None if panel is None else str(panel),
            camera=None,
        )

    return make


@pytest.fixture
def flight(few: Path) -> FleetFlight:
    """One of the few."""
    return flights(few)[0]


@pytest.fixture
def cockpit(tmp_path: Path) -> Path:
    """A panel file that a test may change."""
    folder = tmp_path / "cockpit"
    folder.mkdir()
    shutil.copy(FIXTURES / "panel.jpg", folder)
    shutil.copy(FIXTURES / "panel.yaml", folder)
    return folder / "panel.yaml"


def flights(folder: Path) -> list[FleetFlight]:
    """All flights in a folder."""
    return grouped(flight_files([f"{folder}/*.mcap"]))


def status(outcome: Outcome) -> State:
    """The status of a flight; a reason would show in the assertion."""
    assert outcome.reason == ""
    return outcome.status


def test_finished_flights_are_kept(order: MakeOrder, few: Path, frames: list[Frame], tmp_path: Path) -> None:
    """Only a flight whose content changed is decoded again, not one with only a new date."""
    first = [decode_one(flight, order()) for flight in flights(few)]
    os.utime(few / "flight1_0000.mcap", ns=(1, 1))
    (few / "flight2_0000.mcap").unlink()
    write_flight(few, "flight2", frames[6:10])
    before = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "out").glob("*/*.csv")}
    second = [decode_one(flight, order()) for flight in flights(few)]
    after = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "out").glob("*/*.csv")}

    assert list(map(status, second)) == [State.KEPT, State.KEPT, State.DECODED]
    assert [name for name in before if before[name] == after[name]] == ["flight0.csv", "flight1.csv"]
    assert second[:2] == [replace(outcome, status=State.KEPT) for outcome in first[:2]]


def test_new_date_is_looked_behind_once(order: MakeOrder, flight: FleetFlight, monkeypatch: pytest.MonkeyPatch) -> None:
    """A flight that has only another date is opened once more; then its new date is known."""
    decode_one(flight, order())
    os.utime(flight.addresses[0], ns=(1, 1))
    decode_one(flight, order())
    monkeypatch.setattr("decoder.parallel.decoding.open_flight", None)

    assert status(decode_one(flight, order())) is State.KEPT


@pytest.mark.slow
@pytest.mark.parametrize("other", [{"method": "xcorr"}, {"formats": ("csv", "mcap")}])
def test_other_options_are_decoded_anew(order: MakeOrder, flight: FleetFlight, other: dict[str, object]) -> None:
    """Results of another method or in other formats are not kept; those of the same options are."""
    decode_one(flight, order())

    assert status(decode_one(flight, order(**other))) is State.DECODED
    assert status(decode_one(flight, order(**other))) is State.KEPT


@pytest.mark.slow
def test_formats_have_no_order(order: MakeOrder, flight: FleetFlight, tmp_path: Path) -> None:
    """The same formats in another order are the same results, and fewer leave nothing of the others behind."""
    decode_one(flight, order(formats=("csv", "mcap")))
    again = decode_one(flight, order(formats=("mcap", "csv")))
    decode_one(flight, order())

    assert status(again) is State.KEPT
    assert sorted(path.name for path in (tmp_path / "out" / "flight0").iterdir()) == [
        *("fleet.done", "flight0.csv", "flight0.json", "flight0_alignment.tsv")
    ]


@pytest.mark.slow
def test_other_panel_is_decoded_anew(order: MakeOrder, flight: FleetFlight, cockpit: Path) -> None:
    """A panel with other text or another picture is another panel; the same one elsewhere is not."""
    decode_one(flight, order(panel=cockpit))
    moved = cockpit.parent.rename(cockpit.parents[1] / "moved") / "panel.yaml"
    kept = decode_one(flight, order(panel=moved))
    moved.write_bytes(moved.read_bytes() + b"# a remark\n")
    reworded = decode_one(flight, order(panel=moved))
    (moved.parent / "panel.jpg").write_bytes((FIXTURES / "panel.jpg").read_bytes() + b"\0")
    redrawn = decode_one(flight, order(panel=moved))

    assert list(map(status, (kept, reworded, redrawn))) == [State.KEPT, State.DECODED, State.DECODED]


def test_panel_is_read_as_it_was_when_the_fleet_began(order: MakeOrder, flight: FleetFlight, cockpit: Path) -> None:
    """Whoever changes or removes the panel while a fleet is decoded changes no flight of it."""
    begun = order(panel=cockpit)
    shutil.rmtree(cockpit.parent)

    assert status(decode_one(flight, begun)) is State.DECODED


def test_wrong_panel_is_told_before_any_flight(order: MakeOrder, cockpit: Path) -> None:
    """A panel that is wrong, lacks its picture or has it elsewhere is refused with its name; nothing is made."""
    (cockpit.parent / "panel.jpg").rename(cockpit.parents[1] / "panel.jpg")
    with pytest.raises(PanelError, match=r"panel\.jpg: cannot be read: there is no such file"):
        order(panel=cockpit)
    cockpit.write_text(cockpit.read_text().replace("panel.jpg", "../panel.jpg"))
    with pytest.raises(PanelError, match="in the panel's folder or below"):
        order(panel=cockpit)
    cockpit.write_text(cockpit.read_text().replace("../panel.jpg", "panel.jpg"))
    os.mkfifo(cockpit.parent / "panel.jpg")
    with pytest.raises(PanelError, match="no regular file"):  # and nothing is waited for
        order(panel=cockpit)

    assert not (cockpit.parents[1] / "out").exists()


def test_files_of_others_are_left_alone(order: MakeOrder, flight: FleetFlight, tmp_path: Path) -> None:
    """A folder that holds anything but results is not replaced; what is in it is named."""
    decode_one(flight, order())
    notes = tmp_path / "out" / "flight0" / "notes.txt"
    notes.write_text("mine")
    outcome = decode_one(flight, order(method="xcorr"))

    assert outcome.status is State.FAILED
    assert "notes.txt" in outcome.reason
    assert notes.read_text() == "mine"
    assert (notes.parent / "flight0.csv").exists()


def test_leftovers_of_a_killed_worker_go(order: MakeOrder, flight: FleetFlight, tmp_path: Path) -> None:
    """What a worker left that was killed while it wrote is swept away by the next one; other flights' stay."""
    for name in (".flight0.part-1234", ".flight1.part-1234"):
        (tmp_path / "out" / name).mkdir(parents=True)
        (tmp_path / "out" / name / "flight.csv").write_text("half")
    decode_one(flight, order())

    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [".flight1.part-1234", "flight0"]


def test_marker_that_is_none_is_no_marker(order: MakeOrder, flight: FleetFlight, tmp_path: Path) -> None:
    """If the marker cannot be read, the results count as another program's."""
    decode_one(flight, order())
    for marker in ("", "half a mark", '{"key": {}}', "[]", "null"):
        (tmp_path / "out" / "flight0" / "fleet.done").write_text(marker)

        assert "is no result of flight0" in decode_one(flight, order()).reason, marker


@pytest.mark.parametrize(
    ("fmt", "library"),
    [
        *(("csv", "numpy"), ("mcap", "mcap"), ("mcap", "protobuf"), ("mcap", "zstandard"), ("html", "jinja2")),
        ("parquet", "pyarrow"),
    ],
)
def test_other_versions_are_refused(order: MakeOrder, flight: FleetFlight, fmt: str, library: str) -> None:
    """A worker with another library decodes nothing for us, and says which, if what is asked for is made with it."""
    wanted = order(formats=("csv", fmt))
    other = tuple(f"{library} 0" if name.split()[0] == library else name for name in wanted.versions.libraries)
    needed = any(name.startswith(f"{library} ") for name in order().versions.libraries)

    assert needed == (fmt == "csv")
    with pytest.raises(VersionMismatch, match=rf"has {library} \S+, this machine {library} 0;"):
        decode_one(flight, replace(wanted, versions=replace(wanted.versions, libraries=other)))


@pytest.mark.slow
def test_results_of_other_versions_are_not_kept(
    order: MakeOrder, flight: FleetFlight, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Results are of what computed them: our code, and the libraries."""
    decode_one(flight, order())
    for change in ({"software": "image-flight-recorder 99"}, {"libraries": ("numpy 1",)}):
        other = replace(order().versions, **change)
        monkeypatch.setattr("decoder.parallel.decoding.installed", lambda _formats, other=other: other)

        assert status(decode_one(flight, replace(order(), versions=other))) is State.DECODED, change


@pytest.mark.parametrize("file", ["outputs/report/page/main.js", "outputs/report/page/style.css", "start.py"])
def test_every_file_of_the_code_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str) -> None:
    """A report's page affects results like the Python code; compiled Python files do not."""
    package = tmp_path / "decoder"
    shutil.copytree(decoder.__path__[0], package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(decoder, "__path__", [str(package)])
    before = _digest_of_code.__wrapped__()
    (package / "__pycache__").mkdir()
    (package / "__pycache__" / "cli.cpython.pyc").write_bytes(b"compiled")
    compiled = _digest_of_code.__wrapped__()
    with (package / file).open("a", encoding="utf-8") as stream:
        stream.write(" ")

    assert compiled == before
    assert _digest_of_code.__wrapped__() != before


def test_working_folders_of_killed_workers_go(
    order: MakeOrder, flight: FleetFlight, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What killed workers of this machine left in the temporary folder is removed; that of living ones stays."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    living = f"fleet-{gethostname()}-{os.getppid()}-a"
    for name in (living, f"fleet-{gethostname()}-999999999-a", "fleet-elsewhere-999999999-a"):
        (tmp_path / "tmp" / name).mkdir(parents=True)
    decode_one(flight, order())

    assert sorted(path.name for path in (tmp_path / "tmp").iterdir()) == sorted([living, "fleet-elsewhere-999999999-a"])
