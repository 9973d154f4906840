import marimo

app = marimo.App()


@app.cell
def _():
    import marimo as mo
    import numpy as np
    from scipy.optimize import least_squares

    import surgescope as ss

    return least_squares, mo, np, ss


@app.cell
def _(mo):
    mo.md("""
    # An optimiser of your own

    `simulate` is a function of the parameters, so any optimiser can fit it. Here scipy's `least_squares` does, and ends where `calibrate` ends.

    Zero errors of the sensors, the place of P2 and the clock are no parameters of a simulation. `calibrate` fits them first; then both fits hold them
    at these values.
    """)
    return


@app.cell
def _(mo, ss):
    effects = ["viscoelastic-wall:2"]
    study = ss.Study([mo.notebook_dir() / "../../../recordings/hdpe-nothing-missing.mcap"])
    place = {s.name: s.position_m for s in study.rig.sensors}
    first = study.calibrate(effects, hold={"position_m[P2]": place["P2"]})
    hold = {name: p.value for name, p in first.parameters.items() if "[" in name or name == "closure_start_s"}
    # the steady head at the valve and the zero errors of the sensors shift the same curves
    hold["valve_head_m"] = first.parameters["valve_head_m"].value
    fit = study.calibrate(effects, hold=hold)
    free = [name for name in fit.parameters if name not in hold]
    return effects, fit, free, hold, study


@app.cell
def _(effects, fit, free, hold, np, ss, study):
    sensors = fit.runs[0].sensors
    fixed = {"valve_head_m": hold["valve_head_m"], "reaches": fit.reaches}

    def residual(values):
        """Model less measurement over the noise, all samples of P1, then of P2."""
        parts = []
        for name, sensor in sensors.items():
            heads = ss.simulate(study.rig, effects, set=fixed | dict(zip(free, values)), times_s=sensor.time_s)
            parts.append((heads[name] + hold[f"offset_m[{name}]"] - sensor.measured_m) / sensor.noise_m)
        return np.concatenate(parts)

    return (residual,)


@app.cell
def _(fit, free, least_squares, np, residual):
    # from 10% off in each parameter, the wave speed 2%
    optimum = np.array([fit.parameters[name].value for name in free])
    start = optimum * np.where(np.array(free) == "wave_speed_m_s", 1.02, 1.1)
    result = least_squares(residual, start, x_scale=optimum, diff_step=1e-4)
    errors = np.array([fit.parameters[name].standard_error for name in free])
    apart = (result.x - optimum) / errors
    return apart, result, start


@app.cell
def _(apart, fit, free, mo, result):
    mo.ui.table(
        [
            {"parameter": name, "calibrate": fit.parameters[name].value, "scipy": float(x), "apart, standard errors": float(d)}
            for name, x, d in zip(free, result.x, apart)
        ],
        selection=None,
    )
    return


if __name__ == "__main__":
    app.run()
