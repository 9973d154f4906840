"""Results as tables, pages and pickles."""

import pickle
from pathlib import Path

import numpy as np
import polars as pl
import pyarrow as pa
import pytest
import surgescope as ss
from conftest import RECORDINGS


def test_tables_are_the_same_in_pandas_polars_and_pyarrow(fit: ss.Fit, diagnosis: ss.Diagnosis) -> None:
    for result in (fit, diagnosis, ss.read(RECORDINGS / "hdpe-creep.mcap")):
        frame, polar, arrow = result.to_pandas(), pl.DataFrame(result), pa.table(result)
        assert len(frame) == polar.height == arrow.num_rows > 0
        assert list(frame.columns) == polar.columns == arrow.column_names
        arrow.validate(full=True)
        for name in frame.columns:
            whole = frame[name].astype(object).where(frame[name].notna(), None).tolist()
            assert whole == polar[name].to_list() == arrow[name].to_pylist(), name


def test_a_table_of_a_fit_has_its_parameters(fit: ss.Fit) -> None:
    frame = fit.to_pandas().set_index("name")
    speed = fit.parameters["wave_speed_m_s"]
    assert frame.loc["wave_speed_m_s", "value"] == speed.value and speed.low < speed.value < speed.high
    assert frame["run"].isna()["wave_speed_m_s"] and frame.loc["closing_time_s", "run"] == "hdpe-creep.mcap"
    assert pl.DataFrame(fit)["standard_error"].null_count() == sum(np.isnan(p.standard_error) for p in fit.parameters.values())


def test_a_stream_that_nobody_reads_is_released(fit: ss.Fit) -> None:
    for _ in range(100):
        capsule = fit.__arrow_c_stream__()
        assert "arrow_array_stream" in repr(capsule)
        del capsule


def test_parameters_are_a_mapping(fit: ss.Fit) -> None:
    assert "wave_speed_m_s" in fit.parameters and "nothing" not in fit.parameters
    assert fit.parameters.get("nothing") is None
    with pytest.raises(ss.Error, match="the fit has no parameter 'wave_speed'; it has .*wave_speed_m_s"):
        fit.parameters["wave_speed"]
    with pytest.raises(KeyError):
        fit.parameters["wave_speed"]
    assert fit.parameters["closing_time_s"] is not None
    assert fit.parameters["closing_time_s", "hdpe-creep.mcap"].value == fit.parameters["closing_time_s"].value
    assert fit.correlation.shape == (len(fit.parameters), len(fit.parameters))


def test_curves_are_views_and_their_error_is_the_fits(fit: ss.Fit) -> None:
    [run] = fit.runs
    squares = [np.square(s.measured_m - s.model_m) for s in run.sensors.values()]
    assert np.sqrt(np.concatenate(squares).mean()) == pytest.approx(fit.rmse_m, rel=1e-9)
    p1 = run.sensors["P1"]
    assert len(p1.time_s) == len(p1.model_m) == len(p1.measured_m) and p1.time_s[0] >= 0.0
    assert not p1.model_m.flags.writeable and p1.model_m.base is not None


def test_pieces_for_a_notebook(fit: ss.Fit, diagnosis: ss.Diagnosis) -> None:
    for result, words in ((fit, "wave_speed_m_s"), (diagnosis, "viscoelastic-wall"), (fit.study.recordings[0], "P3")):
        page = result._repr_html_()
        assert page.startswith('<div class="surgescope"') and page.endswith("</div>")
        assert "<svg" in page and words in page and "<script" not in page and "<style>:is(.surgescope, #surgescope) {" in page


def test_fits_and_diagnoses_survive_a_pickle(fit: ss.Fit, diagnosis: ss.Diagnosis) -> None:
    again = pickle.loads(pickle.dumps(fit))
    assert again.to_dict()["parameters"] == fit.to_dict()["parameters"] and again.warnings == fit.warnings
    assert np.array_equal(again.runs[0].sensors["P1"].model_m, fit.runs[0].sensors["P1"].model_m)
    found = pickle.loads(pickle.dumps(diagnosis))
    assert found.to_dict() == diagnosis.to_dict() and found.answer.rmse_m == diagnosis.answer.rmse_m  # type: ignore[union-attr]
    assert again.grow("viscoelastic-wall:1").rmse_m == fit.grow("viscoelastic-wall:1").rmse_m
    with pytest.raises(ss.Error, match="pickled by"):
        ss.Fit._of(b"\x92\xa50.0.9\x80", fit.study, None, [])


def test_a_pickled_study_is_opened_when_it_is_needed(tmp_path: Path) -> None:
    moved = tmp_path / "run.mcap"
    moved.write_bytes((RECORDINGS / "hdpe-creep.mcap").read_bytes())
    study = ss.Study(moved)
    fit = study.calibrate(most_reaches=16)
    kept = pickle.dumps(fit)
    moved.unlink()
    again = pickle.loads(kept)
    assert again.rmse_m == fit.rmse_m and "<svg" in again._repr_html_()
    with pytest.raises(ss.Error, match=r"run\.mcap does not exist"):
        again.diagnose()


def test_a_fit_is_saved_as_the_command_saves_it(tmp_path: Path, fit: ss.Fit) -> None:
    fit.save(tmp_path / "fit.toml")
    assert "converged = " in (tmp_path / "fit.toml").read_text()
    with pytest.raises(ss.Error, match=r"\.toml or \.json"):
        fit.save(tmp_path / "fit.txt")
