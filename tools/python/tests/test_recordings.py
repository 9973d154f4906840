"""Recordings, their arrays and their gaps; files that cannot be read."""

import pickle
from pathlib import Path

import numpy as np
import pytest
import surgescope as ss
from conftest import RECORDINGS, Program


def test_arrays_are_views_of_what_was_recorded() -> None:
    rec = ss.read(RECORDINGS / "hdpe-creep.mcap")
    p1 = rec.sensors["P1"]
    assert (p1.unit, p1.kind, len(p1)) == ("kPa", "pressure", 7430) and p1.time_s.shape == p1.reading.shape == (7430,)
    assert p1.time_s.base is not None and np.shares_memory(p1.time_s, p1.time_s), "no copy"
    assert not p1.reading.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        p1.reading[0] = 0.0
    heads = p1.head_m
    assert heads is not None
    slope, _ = np.polyfit(p1.reading, heads, 1)
    assert slope == pytest.approx(1 / 9.81, rel=5e-3)
    assert rec.sensors["T1"].head_m is None and rec.sensors["T1"].unit == "degC"
    del rec
    assert np.isfinite(p1.time_s).all() and (np.diff(p1.time_s) > 0).all(), "the arrays keep what they show"


def test_a_table_is_imported_as_the_command_does(table: tuple[Path, Path]) -> None:
    csv, rig = table
    rec, own = ss.read(csv, rig=rig), ss.read(RECORDINGS / "hdpe-creep.mcap")
    for name, sensor in own.sensors.items():
        assert np.array_equal(rec.sensors[name].time_s, sensor.time_s)
        assert np.array_equal(rec.sensors[name].reading, sensor.reading)
    assert ss.Study(rec).calibrate(most_reaches=16).rmse_m == ss.Study(own).calibrate(most_reaches=16).rmse_m


def test_gaps_are_as_they_are_and_nan_where_asked_for(tmp_path: Path, table: tuple[Path, Path]) -> None:
    csv, rig = table
    lines = csv.read_text().splitlines(keepends=True)
    holed = tmp_path / "holed.csv"
    holed.write_text("".join(lines[:2001] + lines[2051:]))
    p1 = ss.read(holed, rig=rig).sensors["P1"]
    (from_s, to_s, missing), *more = p1.gaps
    assert not more and missing == 50 and to_s - from_s == pytest.approx(51 * 0.002)
    assert np.isfinite(p1.reading).all()
    time_s, reading, heads = p1.with_nan_gaps()
    assert heads is not None
    assert len(time_s) == len(p1) + 1 and np.isnan(reading).sum() == np.isnan(heads).sum() == 1
    assert from_s < time_s[np.isnan(reading)][0] < to_s and (np.diff(time_s) > 0).all()


def turned(line: str, place: int) -> str:
    """A row whose cell at a place has the other sign."""
    cells = line.rstrip("\n").split(",")
    cells[place] = str(-float(cells[place]))
    return ",".join(cells) + "\n"


def test_a_slip_is_told_as_the_program_tells_it(tmp_path: Path, table: tuple[Path, Path], program: Program) -> None:
    csv, rig = table
    text = csv.read_text()
    lines = text.splitlines(keepends=True)
    tenth = lines[10].split(",", 1)
    spoilt = {
        "word": "".join([*lines[:10], f"{tenth[0]},oops{tenth[1]}", *lines[11:]]),
        "sensor": text.replace("P1", "P9", 1),
        "turned": lines[0] + "".join(turned(line, lines[0].split(",").index("P2")) for line in lines[1:]),
    }
    for name, content in spoilt.items():
        path = tmp_path / f"{name}.csv"
        path.write_text(content)
        told = program("import", path, "--rig", rig, "-o", tmp_path / "x.mcap")
        with pytest.raises(ss.Error) as refused:
            ss.read(path, rig=rig)
        assert told.returncode == 2
        # Guesses that the program shows first are part of the error.
        assert str(refused.value).splitlines()[-1].strip() in told.stderr, (str(refused.value), told.stderr)
    for missing in (tmp_path / "none.mcap", tmp_path / "none.csv"):
        told = program("inspect", missing)
        with pytest.raises(ss.Error) as refused:
            ss.read(missing)
        assert f"error: {refused.value}" == told.stderr.strip()


def test_guesses_are_shown_and_taken_only_where_accepted(tmp_path: Path, table: tuple[Path, Path]) -> None:
    csv, rig = table
    text = csv.read_text().replace("time_s,", "Time,", 1)
    guessed = tmp_path / "guessed.csv"
    guessed.write_text(text)
    with pytest.raises(ss.Error, match=r"as understood(.|\n)*--yes"):
        ss.read(guessed, rig=rig)
    rec = ss.read(guessed, rig=rig, yes=True)
    assert rec.repairs and len(rec.sensors["P1"]) == 7430
    assert len(ss.read(guessed, rig=rig, time_unit="s").sensors["P1"]) == 7430
    with pytest.raises(ss.Error, match="time_unit"):
        ss.read(guessed, rig=rig, time_unit="fortnight")


def test_a_faulty_sensor_is_named(tmp_path: Path, table: tuple[Path, Path]) -> None:
    csv, rig = table
    heading, *rows = csv.read_text().splitlines()
    place = heading.split(",").index("P2")
    flat = [row.split(",") for row in rows]
    for cells in flat:
        cells[place] = "100.0"
    csv.write_text("\n".join([heading, *(",".join(cells) for cells in flat)]) + "\n")
    with pytest.warns(ss.SurgescopeWarning, match="P2"):
        study = ss.Study(ss.read(csv, rig=rig))
    with pytest.raises(ss.Error, match="P2") as refused:
        study.diagnose("none", most_reaches=16)
    assert [(fault["sensor"], fault["fault"]) for fault in refused.value.sensor_faults] == [("P2", "flat")]
    with pytest.warns(ss.SurgescopeWarning, match="P2"):
        again = ss.Study(ss.read(csv, rig=rig), ignore=[])
    assert again.warnings
    assert not [w for w in ss.Study(ss.read(csv, rig=rig), ignore=["P2"]).warnings if "P2" in w]


def test_recordings_and_rigs_survive_a_pickle() -> None:
    rec = ss.read(RECORDINGS / "hdpe-creep.mcap")
    again = pickle.loads(pickle.dumps(rec))
    assert again.file == rec.file and again.rig == rec.rig and again.notes == rec.notes
    for name, sensor in rec.sensors.items():
        assert np.array_equal(again.sensors[name].reading, sensor.reading) and again.sensors[name].gaps == sensor.gaps
    assert hash(again.rig) == hash(rec.rig) and again.rig.name == rec.rig.name
