"""The notebooks under examples, run from top to bottom, and what they must find."""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("marimo")
FOLDER = Path(__file__).parents[1] / "examples"


def ran(name: str) -> dict[str, Any]:
    """The variables of a notebook at its end."""
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    assert spec is not None and spec.loader is not None
    notebook = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(notebook)
    _, variables = notebook.app.run()
    return dict(variables)


def test_every_notebook_is_tried() -> None:
    tried = {"loop", "posterior", "least_squares", "figure"}
    assert {path.stem for path in FOLDER.glob("*.py")} == tried


def test_the_loop_finds_the_creeping_wall_and_ends_at_the_noise() -> None:
    told = ran("loop")
    first, last = told["steps"][0], told["fit"]
    assert last.effects == ["viscoelastic-wall:3"] and told["found"].verdict == "nothing-missing"
    assert first.rmse_m > 20 * first.noise_m and last.rmse_m < 1.1 * last.noise_m


def test_scipy_ends_where_calibrate_ends() -> None:
    told = ran("least_squares")
    assert told["result"].success and len(told["free"]) == 8
    assert np.all(np.abs(told["start"] / told["result"].x - 1) > 0.015)
    assert np.max(np.abs(told["apart"])) < 0.1, told["apart"]


@pytest.mark.night
def test_the_sampled_posterior_is_the_gaussian_one_and_narrower_than_the_intervals() -> None:
    told = ran("posterior")
    # some 400 independent draws: 3.5% of a width, and of the mean 0.05 of it; the grids of 64 and 128 reaches are one width apart
    assert np.all((0.85 < told["width"]) & (told["width"] < 1.15)), told["width"]
    assert np.max(np.abs(told["shift"])) < 2, told["shift"]
    # calibrate's own intervals hold more than the scatter of the samples
    for name, spread in zip(told["free"], told["samples"].std(axis=0)):
        assert spread < told["fit"].parameters[name].standard_error, name


def test_the_figure_shows_the_error_falling(tmp_path: Path) -> None:
    import matplotlib

    matplotlib.use("agg")
    told = ran("figure")
    told["figure"].savefig(tmp_path / "figure.pdf")
    top, below = told["figure"].axes
    assert len(top.lines) == 3 and len(below.lines) == 2
    elastic, creeping = (np.std(line.get_ydata()) for line in below.lines)
    assert creeping < 0.05 * elastic
    # one clock: what the model leaves between the curves of the upper panel is what the lower one shows
    measured, _, model = top.lines
    assert np.array_equal(measured.get_xdata(), model.get_xdata())
    assert np.array_equal(model.get_ydata() - measured.get_ydata(), below.lines[1].get_ydata())
