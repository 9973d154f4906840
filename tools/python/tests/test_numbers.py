"""The numbers are the command line's, to the last digit."""

import csv
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import surgescope as ss
from conftest import RECORDINGS, RIGS, Program

SIMULATED: list[tuple[str, list[str], dict[str, float]]] = [
    ("demo-hdpe.toml", ["viscoelastic-wall:2", "leak"], {"J1_per_GPa": 0.12, "tau1_s": 0.05, "leak_position_m": 60.0}),
    ("paper-ppr.toml", [], {"initial_velocity_m_s": 1.0, "reaches": 96}),
    ("imperial-pe.toml", ["unsteady-friction"], {"initial_velocity_m_s": 0.3, "valve_head_m": 45.0}),
]


def simulates_alike(folder: Path, program: Program, rig: Path, effects: list[str], values: dict[str, float]) -> None:
    """The command and the library give the same readings."""
    out = folder / "out.csv"
    settings = [f"{name}={value}" for name, value in values.items()]
    done = program(
        "simulate", "--rig", rig, "--effects", ",".join(effects) or "none", "--set", *settings,
        "--duration", 3, "--csv-times", 0.01, "-o", out,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with out.open() as file:
        written = list(csv.DictReader(file))
    times_s = np.array([float(row["time_s"]) for row in written])
    shown = ss.simulate(rig, effects, values, times_s=times_s, readings=True)
    assert len(written) == 301 and set(shown) == set(written[0]) - {"time_s"}
    for name, readings in shown.items():
        # The command writes twelve digits.
        assert [float(f"{value:.11e}") for value in readings] == [float(row[name]) for row in written]


@pytest.mark.parametrize(("rig", "effects", "values"), SIMULATED)
def test_simulate_gives_what_the_command_writes(
    tmp_path: Path, program: Program, rig: str, effects: list[str], values: dict[str, float]
) -> None:
    simulates_alike(tmp_path, program, RIGS / rig, effects, values)


def test_an_effect_of_the_rigs_own_is_one_like_any_other(tmp_path: Path, program: Program) -> None:
    rig = tmp_path / "rig.toml"
    shutil.copy(RIGS / "demo-hdpe.toml", rig)
    (tmp_path / "effects").mkdir()
    made = program("effects", "new", "relief-valve", "-o", tmp_path / "effects" / "relief-valve.toml")
    assert made.returncode == 0, made.stderr
    values = {"position_m": 41.0, "set_head_m": 36.0, "cda_mm2": 12.0}
    simulates_alike(tmp_path, program, rig, ["relief-valve"], values)
    times_s = np.linspace(0.0, 1.0, 50)
    with_it = ss.simulate(rig, "relief-valve", values, times_s=times_s)
    without = ss.simulate(rig, times_s=times_s)
    assert any(np.abs(with_it[name] - without[name]).max() > 0.5 for name in without)


def test_heads_are_readings_in_metres() -> None:
    rig = RIGS / "paper-ppr.toml"
    times_s = np.linspace(0.0, 1.0, 50)
    heads = ss.simulate(rig, set={"initial_velocity_m_s": 0.5}, times_s=times_s)
    readings = ss.simulate(rig, set={"initial_velocity_m_s": 0.5}, times_s=times_s, readings=True)
    for sensor in ss.Rig.load(rig).sensors:
        if sensor.kind == "pressure":
            per_m = {"kPa": 9.81, "bar": 0.0981, "m(H2O)": 1.0}[sensor.unit]
            # the water is not of 1000 kg/m3
            assert readings[sensor.name] == pytest.approx(per_m * heads[sensor.name], rel=5e-3)


def test_many_simulations_are_each_what_one_is() -> None:
    rig = ss.Rig.load(RIGS / "demo-hdpe.toml")
    times_s = np.linspace(0.0, 2.0, 100)
    creep = [0.05, 0.1, 0.2]
    many = ss.simulate_many(rig, ["viscoelastic-wall:1"], {"J1_per_GPa": creep}, {"tau1_s": 0.05}, times_s=times_s)
    for row, j in enumerate(creep):
        one = ss.simulate(rig, ["viscoelastic-wall:1"], {"J1_per_GPa": j, "tau1_s": 0.05}, times_s=times_s)
        for name in one:
            assert np.array_equal(many[name][row], one[name])
    assert many["P1"].shape == (3, 100) and not np.array_equal(many["P1"][0], many["P1"][1])


def same(parameters: list[dict[str, Any]], own: ss.Parameters) -> None:
    """Those of a document and those of a fit are equal."""
    assert len(parameters) == len(own) > 0
    for p, q in zip(parameters, own.values(), strict=True):
        assert (p["name"], p.get("run"), p["value"], p["unit"]) == (q.name, q.run, q.value, q.unit)
        assert (p["at_bound"], p["held"], p["lower"], p["upper"]) == (q.at_bound, q.held, q.lower, q.upper)
        assert p["standard_error"] == (q.standard_error if np.isfinite(q.standard_error) else None)
        ends = [end if np.isfinite(end) else None for end in (q.low, q.high)]
        assert p["interval_95"] == ends


def test_calibrate_gives_what_the_command_prints(document: Any) -> None:
    file = RECORDINGS / "hdpe-nothing-missing.mcap"
    told = document("calibrate", file, "--effects", "viscoelastic-wall:1", "--hold", "closing_time_s=0.1", "--most-reaches", 64)
    fit = ss.Study([file]).calibrate(["viscoelastic-wall:1"], hold={"closing_time_s": 0.1}, most_reaches=64)
    assert (fit.rmse_m, fit.noise_m, fit.effects) == (told["rmse_m"], told["noise_m"], told["effects"])
    assert (fit.reaches, fit.evaluations, fit.converged) == (told["reaches"], told["evaluations"], told["converged"])
    assert fit.warnings == told["warnings"]
    same(told["parameters"], fit.parameters)
    own = fit.to_dict()
    for changing in ("fitted_at", "seconds"):
        del own[changing], told[changing]
    assert own == told
    held = fit.parameters["closing_time_s"]
    assert held.held and (held.value, held.low, held.high, held.standard_error) == (0.1, 0.1, 0.1, 0.0)


@pytest.mark.night
def test_a_posterior_is_the_commands(document: Any) -> None:
    file = RECORDINGS / "hdpe-nothing-missing.mcap"
    told = document("calibrate", file, "--effects", "viscoelastic-wall:2", "--most-reaches", 32, "--posterior", 100)
    study = ss.Study([file])
    fit = study.calibrate(["viscoelastic-wall:2"], most_reaches=32, posterior=100)
    same(told["parameters"], fit.parameters)
    sampled = fit.posterior
    assert sampled is not None and sampled.converged == told["posterior"]["converged"]
    assert sampled.r_hat.max() == told["posterior"]["r_hat"]
    assert sampled.effective_draws.min() == told["posterior"]["effective_draws"] >= 100
    assert sampled.draws.shape == (len(sampled.draws), len(sampled.names)) and len(sampled.draws) > 100
    of = {(p["name"], p.get("run")): p for p in told["parameters"] if "posterior" in p}
    assert list(of) == list(zip(sampled.names, sampled.runs, strict=True))
    rows = zip(of.values(), sampled.draws.T, sampled.median, sampled.interval_95, strict=True)
    for p, draws, median, interval in rows:
        ends = [end if np.isfinite(end) else None for end in interval]
        assert (median, ends) == (p["posterior"]["median"], p["posterior"]["interval_95"])
        assert fit.parameters[p["name"]].doubt == p.get("doubt")
        # The interval is of all draws, of which these are some: about 95 of 100 lie inside.
        assert 0.85 < np.mean((interval[0] <= draws) & (draws <= interval[1])) <= 1.0

    again = study.calibrate(["viscoelastic-wall:2"], most_reaches=32)
    assert again.posterior is None
    later = again.sample(100).posterior
    assert later is not None and np.array_equal(later.draws, sampled.draws), "a fit sampled later has the same draws"
    for asked in (99, 200_000):
        with pytest.raises(ss.Error, match="from 100 to 100000"):
            again.sample(asked)


def test_several_runs_bounds_starts_and_methods_are_the_commands(document: Any, tmp_path: Path, program: Program) -> None:
    files = []
    for number, closing in enumerate((0.1, 0.3)):
        files.append(tmp_path / f"{number}.mcap")
        values = ["initial_velocity_m_s=0.4", f"closing_time_s={closing}", "J1_per_GPa=0.1", "tau1_s=0.05"]
        done = program(
            "simulate", "--rig", RIGS / "demo-hdpe.toml", "--effects", "viscoelastic-wall:1", "--set", *values,
            "--duration", 3, "--seed", number, "-o", files[-1],
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    told = document(
        "calibrate", *files, "--effects", "viscoelastic-wall:1", "--hold", "J1_per_GPa=0.05:0.3", "--start", "tau1_s=0.1",
        "--starts", 2, "--seed", 7, "--most-reaches", 32,
    )  # fmt: skip
    fit = ss.Study(files).calibrate(
        "viscoelastic-wall:1", hold={"J1_per_GPa": (0.05, 0.3)}, start={"tau1_s": 0.1}, starts=2, seed=7, most_reaches=32
    )
    same(told["parameters"], fit.parameters)
    assert fit.rmse_m == told["rmse_m"] and [run.file for run in fit.runs] == ["0.mcap", "1.mcap"]
    assert (fit.parameters["J1_per_GPa"].lower, fit.parameters["J1_per_GPa"].upper) == (0.05, 0.3)
    first, second = (fit.parameters["closing_time_s", f"{number}.mcap"] for number in (0, 1))
    assert second.value - first.value == pytest.approx(0.2, abs=0.05)
    with pytest.raises(ss.UnknownParameter, match=r"each run has its own closing_time_s.*0\.mcap, 1\.mcap"):
        fit.parameters["closing_time_s"]


def test_diagnose_gives_what_the_command_prints(document: Any) -> None:
    file = RECORDINGS / "hdpe-creep.mcap"
    told = document("diagnose", file, "--effects", "none", "--most-reaches", 32)
    found = ss.Study([file]).diagnose("none", most_reaches=32)
    assert found.verdict == told["verdict"] == "missing-effect"
    assert len(found.candidates) == len(told["candidates"]) > 5
    for c, own in zip(told["candidates"], found.candidates, strict=True):
        assert (c["effect"], c["probability"], c["rmse_m"]) == (own.effect, own.probability, own.rmse_m)
        assert c["indistinguishable_from"] == own.indistinguishable_from
        assert [p["value"] for p in c["parameters"]] == [p.value for p in own.parameters.values()]
    assert found.to_dict() == told


def test_the_loop_finds_and_adds_what_is_missing(fit: ss.Fit, diagnosis: ss.Diagnosis) -> None:
    assert diagnosis.candidates[0].effect == "viscoelastic-wall" and diagnosis.start.rmse_m == fit.rmse_m
    grown = fit.grow("viscoelastic-wall:1")
    assert grown.evidence is not None and grown.evidence > 0 and fit.evidence is None
    assert grown.rmse_m < 0.5 * fit.rmse_m and grown.effects == ["viscoelastic-wall:1"]
    back = grown.without("viscoelastic-wall")
    assert back.effects == [] and back.rmse_m == pytest.approx(fit.rmse_m, rel=0.05)
    answer = diagnosis.answer
    assert answer is not None and answer.rmse_m < 0.1 * fit.rmse_m
