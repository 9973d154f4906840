"""Fit simulated closures from a tenth of the wave's return time, 2L/a, to 25 times it, and print the results as a Markdown table.

closures.py PROGRAM RIG… [--seeds N] [--times A,B,…] [--periods N] [--set NAME=VALUE…] [--noise-m M] [--details]

Each closure is recorded twice: on a rig file that states the closing time, and on one that states its own, whatever the valve does. A fit is down to
the noise where it leaves no more than 1.1 times the noise that the simulation added. --details prints a line a fit."""
import argparse
import json
import re
import subprocess
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

DOWN_TO_THE_NOISE = 1.1
TIMES = "0.1,0.3,0.7,1,1.5,2.5,4,6,10,16,25"


def said(*command):
    run = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if run.returncode not in (0, 3):
        raise RuntimeError(run.stderr.strip().splitlines()[-1])
    return run.stdout


def fitted(args, rig_text, name, share, stated, seed, work):
    """One closure that takes `share` of 2L/a: what `inspect` and `calibrate` make of its record."""
    at = Path(tempfile.mkdtemp(dir=work))
    rig, record = at / f"{name}.toml", at / "run.mcap"
    rig.write_text(rig_text)
    length_m = sum(pipe["length_m"] for pipe in tomllib.loads(rig_text)["pipe"])
    program = args.program
    settings = json.loads(said(program, "simulate", "--rig", rig, "--set", *args.set, "--json", "-o", at / "any.mcap"))["settings"]
    return_s = 2 * length_m / settings["wave_speed_m_s"]
    closing_s = share * return_s
    true = {"wave_speed_m_s": settings["wave_speed_m_s"], "closing_time_s": closing_s}
    if stated:
        rig.write_text(re.sub(r"(?m)^closing_time_s = \S+", f"closing_time_s = {closing_s:.6f}", rig_text))
    said(program, "simulate", "--rig", rig, "--set", *args.set, f"closing_time_s={closing_s}", "--seed", seed,
         "--duration", closing_s + args.periods * 2 * return_s, *(["--noise-m", args.noise_m] if args.noise_m else []), "-o", record)
    row = {"rig": name, "share": share, "stated": stated, "seed": seed, "true_m_s": settings["wave_speed_m_s"]}
    try:
        shown = json.loads(said(program, "inspect", record, "--json"))
        noise_m = float(re.search(r"noise ([\d.]+) m", shown["notes"][0]["value"]).group(1))
        speeds = shown["wave_speed_m_s"]
        row |= {"slow": bool((speeds["crossings"] or {}).get("slow_closure")), "shown": {k: (v or {}).get("value") for k, v in speeds.items()},
                "faults": shown["sensor_faults"], "period_s": (shown["period_s"] or {}).get("value"), "return_s": return_s, "doubts": shown["doubts"]}
        fit = json.loads(said(program, "calibrate", record, "--json"))
        run = fit["runs"][0]
        samples = sum(s["samples"] for s in run["sensors"])
        before_m = (sum(s["samples"] * s["start_rmse_m"] ** 2 for s in run["sensors"]) / samples) ** 0.5
        row |= {"left": run["rmse_m"] / noise_m, "before": before_m / noise_m,
                "off": {p["name"]: (p["value"] - true[p["name"]]) / p["standard_error"] for p in fit["parameters"]
                        if p["name"] in true and p["standard_error"]}}
    except RuntimeError as error:
        row |= {"left": float("inf"), "before": float("nan"), "error": str(error)}
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("rigs", nargs="+", type=Path)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--times", default=TIMES)
    parser.add_argument("--periods", type=float, default=10, help="recorded after the end of the closure")
    parser.add_argument("--set", nargs="+", default=["initial_velocity_m_s=1"])
    parser.add_argument("--noise-m", type=float)
    parser.add_argument("--details", action="store_true")
    args = parser.parse_args()
    times = [float(t) for t in args.times.split(",")]
    cases = [(rig, time, stated, seed) for rig in args.rigs for time in times for stated in (True, False)
             for seed in range(1, args.seeds + 1)]
    with tempfile.TemporaryDirectory() as work, ThreadPoolExecutor(2) as pool:
        rows = list(pool.map(lambda c: fitted(args, c[0].read_text(), c[0].stem, *c[1:], work), cases))
    if args.details:
        for row in rows:
            shown = row.get("shown", {})
            speeds = " ".join(f"{k} {v / row['true_m_s']:.3f}" for k, v in shown.items() if v)
            period = row["period_s"] / (2 * row["return_s"]) if row.get("period_s") else float("nan")
            faults = [fault["fault"] for fault in row.get("faults", [])]
            print(f"{row['rig']:16} {row['share']:5} {'stated' if row['stated'] else 'own':6} {row['seed']} left {row['left']:7.2f} began "
                  f"{row['before']:7.2f} slow {row.get('slow')} period {period:.3f} {speeds} {row.get('error', '')} {faults or ''}", flush=True)
        print()
    print("| rig | " + " | ".join(f"{t:g}" for t in times) + " |")
    print("| --- |" + " --- |" * len(times))
    for rig in args.rigs:
        worst = [max(r["left"] for r in rows if r["rig"] == rig.stem and r["share"] == t) for t in times]
        print(f"| {rig.stem} | " + " | ".join(f"{w:.2f}" if w <= DOWN_TO_THE_NOISE else f"**{w:.2f}**" for w in worst) + " |")
    down = sum(r["left"] <= DOWN_TO_THE_NOISE for r in rows)
    worse = sum(r["left"] > r["before"] for r in rows)
    print(f"\n{down} of {len(rows)} fits are down to the noise, {down / len(rows):.1%}; {worse} end worse than they began.")
    for name in ("wave_speed_m_s", "closing_time_s"):
        off = [row["off"][name] for row in rows if name in row.get("off", {})]
        within = sum(abs(z) < 1.96 for z in off)
        if off:
            print(f"{name}: {within} of {len(off)} within 1.96 standard errors of the truth; rms {(sum(z * z for z in off) / len(off)) ** 0.5:.2f}, worst {max(map(abs, off)):.1f}")


main()
