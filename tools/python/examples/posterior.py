import marimo

app = marimo.App()


@app.cell
def _():
    import emcee
    import marimo as mo
    import numpy as np

    import surgescope as ss

    return emcee, mo, np, ss


@app.cell
def _(mo):
    mo.md("""
    # Intervals, sampled

    An interval from the curvature at the optimum (Gauss) is right where the misfit is a parabola. A sampler needs no such assumption: emcee draws from
    the posterior over `simulate_many`, one row a walker. Where the two agree, Gauss can be believed.

    `calibrate`'s own intervals are wider than both. They also hold what the scatter of the samples does not tell: residuals that go together, and how
    well the rig file knows the pipe and the sensors. Zero errors of the sensors, the place of P2, the clock and the steady head are held here.
    """)
    return


@app.cell
def _(mo, ss):
    effects = ["viscoelastic-wall:2"]
    study = ss.Study([mo.notebook_dir() / "../../../recordings/hdpe-nothing-missing.mcap"])
    place = {s.name: s.position_m for s in study.rig.sensors}
    first = study.calibrate(effects, hold={"position_m[P2]": place["P2"]})
    hold = {n: p.value for n, p in first.parameters.items() if "[" in n or n in ("closure_start_s", "valve_head_m")}
    fit = study.calibrate(effects, hold=hold)
    free = [name for name in fit.parameters if name not in hold]
    return effects, fit, free, hold, study


@app.cell
def _(effects, fit, free, hold, np, ss, study):
    every = 4
    sensors = fit.runs[0].sensors
    fixed = {"valve_head_m": hold["valve_head_m"], "reaches": 64}
    times_s = next(iter(sensors.values())).time_s[::every]

    def residuals(rows):
        """Model less measurement over the noise: a row a set of values, a column a sample of one of the sensors."""
        heads = ss.simulate_many(study.rig, effects, dict(zip(free, rows.T)), set=fixed, times_s=times_s, failed="nan")
        parts = [
            (heads[name] + hold[f"offset_m[{name}]"] - sensor.measured_m[::every]) / sensor.noise_m
            for name, sensor in sensors.items()
        ]
        return np.concatenate(parts, axis=1)

    return (residuals,)


@app.cell
def _(fit, free, np, residuals):
    optimum = np.array([fit.parameters[name].value for name in free])
    steps = np.diag(1e-3 * optimum)
    slopes = (residuals(optimum + steps) - residuals(optimum - steps)) / (2e-3 * optimum[:, None])
    gauss = np.linalg.inv(slopes @ slopes.T)
    return gauss, optimum


@app.cell
def _(emcee, free, gauss, np, optimum, residuals):
    walkers = 32
    rng = np.random.default_rng(1)

    def log_posterior(rows):
        """Gaussian noise, flat priors."""
        total = -0.5 * np.sum(residuals(rows) ** 2, axis=1)
        return np.where(np.isfinite(total), total, -np.inf)

    sampler = emcee.EnsembleSampler(walkers, len(free), log_posterior, vectorize=True)
    sampler.random_state = np.random.RandomState(1).get_state()
    sampler.run_mcmc(rng.multivariate_normal(optimum, gauss, size=walkers), 400)
    samples = sampler.get_chain(discard=50, flat=True)
    errors = np.sqrt(np.diag(gauss))
    shift = (samples.mean(axis=0) - optimum) / errors
    width = samples.std(axis=0) / errors
    return errors, samples, sampler, shift, width


@app.cell
def _(errors, fit, free, mo, optimum, samples):
    mo.ui.table(
        [
            {"parameter": n, "optimum": x, "sampled ±": s, "Gauss ±": e, "calibrate ±": fit.parameters[n].standard_error}
            for n, x, s, e in zip(free, optimum, samples.std(axis=0), errors)
        ],
        selection=None,
    )
    return


if __name__ == "__main__":
    app.run()
