"""What is refused, and in whose words."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import surgescope as ss
from conftest import RECORDINGS, RIGS, Program

RIG = RIGS / "demo-hdpe.toml"
NONE = "none"


def simulated(program: Program, *arguments: object) -> str:
    done = program("simulate", "--rig", RIG, "--duration", 0.1, *arguments)
    assert done.returncode == 2
    return done.stderr


@pytest.mark.parametrize(
    ("effects", "values"),
    [(["lek"], {}), (["none"], {"wave_sped_m_s": 3.0}), (["leak"], {"J1_per_GPa": 1.0}), ([], {"reaches": 2.5}), ([], {"valve_head_m": -1e3})],
)
def test_simulate_refuses_in_the_words_of_the_program(program: Program, effects: list[str], values: dict[str, float]) -> None:
    settings = [f"{name}={value}" for name, value in values.items()]
    told = simulated(program, "--effects", ",".join(effects), *(["--set", *settings] if settings else []))
    with pytest.raises(ss.Error) as refused:
        ss.simulate(RIG, effects, values, times_s=[0.0])
    assert isinstance(refused.value, ValueError) and str(refused.value) in told


@pytest.mark.parametrize(
    "arguments",
    [
        ("--hold", "nothing=3"),
        ("--effects", "leak,leak"),
        ("--method", "global", "--starts", "3"),
        ("--start", "nothing=3"),
        ("--hold", "wave_speed_m_s=300", "--start", "wave_speed_m_s=400"),
    ],
)
def test_calibrate_refuses_in_the_words_of_the_program(study: ss.Study, program: Program, arguments: tuple[str, ...]) -> None:
    told = program("calibrate", RECORDINGS / "hdpe-creep.mcap", "--most-reaches", 16, *arguments)
    assert told.returncode == 2
    call: dict[str, object] = {"most_reaches": 16}
    for option, value in zip(arguments[::2], arguments[1::2], strict=True):
        name, equals, number = value.partition("=")
        key = option.removeprefix("--")
        call[key] = {name: float(number)} if equals else int(value) if value.isdigit() else value
    with pytest.raises(ss.Error) as refused:
        study.calibrate(**call)  # type: ignore[arg-type]
    assert str(refused.value) in told.stderr


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: ss.Study([]), "there is no recording"),
        (lambda: ss.Study([RECORDINGS / "hdpe-creep.mcap"] * 2), "given twice"),
        (lambda: ss.Study([RECORDINGS / "hdpe-creep.mcap", RECORDINGS / "copper-leak.mcap"]), "separately"),
        (lambda: ss.Rig.from_toml("name = 1"), "rig.toml"),
        (lambda: ss.read(RIG), "the rig is missing"),
        (lambda: ss.read(RECORDINGS), "is a folder"),
        (lambda: ss.simulate(RIG, times_s=[np.nan]), "finite"),
        (lambda: ss.simulate(RIG, times_s=[[0.0, 1.0]]), "times_s: give numbers in a list"),
        (lambda: ss.simulate_many(RIG, NONE, {"reaches": 8}, times_s=[0.0]), "reaches: give numbers in a list"),
        (lambda: ss.simulate_many(RIG, NONE, {"reaches": [8]}, times_s=[0.0], threads=0), "threads must be 1 or more"),
        (lambda: ss.simulate(RIG, set={"reaches": "many"}, times_s=[0.0]), "reaches = many is not a number"),  # type: ignore[dict-item]
        (lambda: ss.Study(RECORDINGS / "hdpe-creep.mcap").calibrate(most_reaches=4), "most_reaches must be a whole number from 8"),
        (lambda: ss.Study(RECORDINGS / "hdpe-creep.mcap").calibrate(hold={"wave_speed_m_s": "fast"}), "give a number"),  # type: ignore[dict-item]
        (lambda: ss.simulate(RIG, set={"reaches": np.inf}, times_s=[0.0]), "finite"),
        (lambda: ss.simulate(RIG, times_s=[0.0], valve="ball"), "linear, flow-ramp"),  # type: ignore[arg-type]
        (lambda: ss.simulate_many(RIG, NONE, {"reaches": [8, 9.5]}, times_s=[0.0]), "row 1: reaches = 9.5"),
        (lambda: ss.simulate_many(RIG, NONE, {"reaches": [8], "valve_head_m": [1, 2]}, times_s=[0.0]), "as many"),
        (lambda: ss.Study(RECORDINGS / "hdpe-creep.mcap").calibrate(method="magic"), "least-squares, global"),  # type: ignore[arg-type]
        (lambda: ss.Study(RECORDINGS / "hdpe-creep.mcap", ignore=["P9"]), "no sensor named 'P9'"),
    ],
)
def test_slips_are_errors_that_say_what_to_do(call: Callable[[], object], words: str) -> None:
    with pytest.raises(ss.Error, match=words):
        call()


def test_rows_that_fail_are_nan_where_asked_for() -> None:
    table = pd.DataFrame({"reaches": [16.0, 16.5, 16.0]})
    heads = ss.simulate_many(RIG, NONE, table, times_s=[0.0, 0.1], failed="nan")["P1"]
    assert np.isfinite(heads[[0, 2]]).all() and np.isnan(heads[1]).all()


def test_a_model_that_should_boil_warns() -> None:
    with pytest.warns(ss.SurgescopeWarning, match="vapour"):
        ss.simulate(RIG, set={"initial_velocity_m_s": 3.0, "valve_head_m": 10.0}, times_s=np.linspace(0, 3, 10))


def test_defaults_are_what_a_simulation_uses() -> None:
    unset = ss.defaults(RIG, ["leak"], {"leak_position_m": 60.0})
    assert "leak_position_m" not in unset and unset["temperature_degC"] > 0
    spelled = {name: value for name, value in unset.items() if name not in ("temperature_degC", "friction_factor")}
    times_s = np.linspace(0, 1, 20)
    implied = ss.simulate(RIG, ["leak"], {"leak_position_m": 60.0}, times_s=times_s)
    written = ss.simulate(RIG, ["leak"], {"leak_position_m": 60.0, **spelled}, times_s=times_s)
    assert np.array_equal(implied["P1"], written["P1"])


def test_a_value_that_no_fit_would_take_warns(study: ss.Study) -> None:
    with pytest.warns(ss.SurgescopeWarning, match="check its unit"):
        study.calibrate(hold={"wave_speed_m_s": 3600.0}, most_reaches=16)


def test_the_console_script_is_the_program(tmp_path: Path) -> None:
    script = Path(sys.executable).parent / "surgescope"

    def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run([script, *arguments], capture_output=True, text=True, timeout=60)

    assert run("--version").stdout.startswith("surgescope ")
    refused = run("inspect", str(tmp_path / "none.mcap"))
    assert refused.returncode == 2 and refused.stderr.startswith("error: ") and refused.stdout == ""
    assert run("no-such-command").returncode == 2
    assert run("effects", "--json").stdout.startswith("{")


def test_the_console_script_starts_itself_for_a_campaign(tmp_path: Path) -> None:
    script = Path(sys.executable).parent / "surgescope"
    plan, folder = tmp_path / "plan.toml", tmp_path / "study"
    plan.write_text(f'kind = "calibrate"\nrecordings = ["{RECORDINGS}/copper-leak.mcap"]\neffects = [["none"]]\n[options]\nmost_reaches = 16\n')
    calls: tuple[list[Path | str], ...] = (["plan", plan, "-o", folder], ["run", folder], ["status", folder], ["submit", folder, "--to", "slurm"])
    for words in calls:
        done = subprocess.run([script, "campaign", *words], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert f"exec '{script}' campaign run" in (folder / "jobs" / "slurm.sh").read_text()
