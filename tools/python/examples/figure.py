import marimo

app = marimo.App()


@app.cell
def _():
    import marimo as mo
    import matplotlib.pyplot as plt

    import surgescope as ss

    return mo, plt, ss


@app.cell
def _(mo):
    mo.md("""
    # A figure for a paper

    Measured head, the elastic model and the model with a creeping wall, and what each leaves. 90 mm wide, as one column of a journal.
    """)
    return


@app.cell
def _(mo, ss):
    study = ss.Study([mo.notebook_dir() / "../../../recordings/hdpe-creep.mcap"])
    elastic = study.calibrate(effects=["none"])
    creeping = study.calibrate(effects=["viscoelastic-wall"])
    return creeping, elastic


@app.cell
def _(creeping, elastic, plt):
    def draw():
        small = {"font.size": 8, "axes.linewidth": 0.6, "xtick.direction": "in", "ytick.direction": "in", "savefig.dpi": 300}
        with plt.rc_context(small):
            figure, (top, below) = plt.subplots(
                2, 1, sharex=True, figsize=(3.54, 3.2), height_ratios=[2, 1], constrained_layout=True
            )
            first, last = elastic.runs[0].sensors["P1"], creeping.runs[0].sensors["P1"]
            # times count from the start of the closure, which each fit finds for itself: both on the clock of the second
            starts = [fit.parameters["closure_start_s"].value for fit in (elastic, creeping)]
            first_time_s = first.time_s + (starts[0] - starts[1])
            top.plot(last.time_s, last.measured_m, color="0.65", lw=2.5, label="measured")
            top.plot(first_time_s, first.model_m, color="C1", lw=0.8, ls="--", label=f"elastic, RMSE {first.rmse_m:.2f} m")
            top.plot(last.time_s, last.model_m, color="C0", lw=0.8, label=f"creeping wall, RMSE {last.rmse_m:.2f} m")
            low, high = top.get_ylim()
            top.set_ylim(low, high + 0.45 * (high - low))
            top.legend(frameon=False, loc="upper right", handlelength=1.8)
            top.set_ylabel("head $H$ (m)")
            below.plot(first_time_s, first.model_m - first.measured_m, color="C1", lw=0.6)
            below.plot(last.time_s, last.model_m - last.measured_m, color="C0", lw=0.6)
            below.set_ylabel("residual (m)")
            below.set_xlabel("time since the closure starts (s)")
            below.set_xlim(0, float(last.time_s[-1]))
            for axes, letter in [(top, "a"), (below, "b")]:
                axes.tick_params(top=True, right=True, width=0.6)
                axes.text(0.02, 0.95, f"({letter})", transform=axes.transAxes, va="top")
        return figure

    figure = draw()
    figure
    return draw, figure


if __name__ == "__main__":
    app.run()
