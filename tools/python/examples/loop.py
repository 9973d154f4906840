import marimo

app = marimo.App()


@app.cell
def _():
    import marimo as mo

    import surgescope as ss

    return mo, ss


@app.cell
def _(mo):
    mo.md("""
    # What is missing?

    The recording was made by another simulator: a pipe of HDPE whose wall creeps. The first model knows nothing of that.
    The loop fits it, asks what is missing, adds that, and fits again, until nothing is left to find.
    """)
    return


@app.cell
def _(mo, ss):
    study = ss.Study([mo.notebook_dir() / "../../../recordings/hdpe-creep.mcap"])
    fit = study.calibrate(effects=["none"])
    steps = [fit]
    while (found := fit.diagnose()).verdict == "missing-effect":
        fit = fit.grow(found.candidates[0].effect)
        steps.append(fit)
    return fit, found, steps, study


@app.cell
def _(mo, steps):
    mo.md("\n".join(f"- {' + '.join(s.effects) or 'elastic pipe'}: **{s.rmse_m:.3f} m** at a noise of {s.noise_m:.3f} m" for s in steps))
    return


@app.cell
def _(found):
    found
    return


@app.cell
def _(fit):
    fit
    return


if __name__ == "__main__":
    app.run()
