#!/usr/bin/env python3
"""The searches that a calibration knows, side by side on ten runs; writes a table in Markdown.

    cargo build --release
    cargo run --release -p surgescope-tools --bin hidden_effects -- 11 9 FOLDER nothing
    python3 tools/methods.py target/release/surgescope FOLDER -o docs/src/measured/methods.md

Ten runs: the three of recordings/ and seven of FOLDER, each with the effects that it was made with. A run's best error is the least that any search found,
of any seed. Least squares with random starts runs with five seeds, population searches with two; what draws nothing runs once.
"""

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SHIPPED = [
    ("hdpe-creep", "viscoelastic-wall:3"),
    ("hdpe-nothing-missing", "viscoelastic-wall:3"),
    ("copper-leak", "unsteady-friction,leak"),
]
DRAWN = ["case-001", "case-002", "case-003", "case-004", "case-006", "case-007", "case-009"]
# Name, options, seeds. Population searches get the budget besides.
POPULATIONS = {"global", "micro-ga", "global-local"}
METHODS = [
    ("stepwise", ["--method", "stepwise"], 1),
    ("least squares", [], 1),
    ("least squares, 8 more starts", ["--starts", "8"], 5),
    ("global", ["--method", "global"], 2),
    ("micro-GA", ["--method", "micro-ga"], 2),
    ("global-local", ["--method", "global-local"], 2),
]
FOUND = 0.005


def fit(job: tuple) -> dict:
    program, recording, effects, options, seed, budget = job
    command = [program, "calibrate", str(recording), "--effects", effects, "--json", "--seed", str(seed)]
    if POPULATIONS.intersection(options):
        command += ["--budget", str(budget)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([*command, *options], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: {done.stderr}")
    answer = json.loads(done.stdout)
    run = answer["runs"][0]
    return {
        "rmse_m": run["rmse_m"],
        "over_noise": run["rmse_m"] / run["noise_m"],
        "converged": answer["converged"],
        "solves": answer["evaluations"],
        "seconds": answer["seconds"],
        "cpu": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
    }


def runs(program: str, folder: Path, scratch: Path):
    for name, effects in SHIPPED:
        yield name, ROOT / "recordings" / f"{name}.mcap", effects
    answers = json.loads((folder / "answers.json").read_text())
    for name in DRAWN:
        mcap = scratch / f"{name}.mcap"
        case = folder / name
        command = [program, "import", str(case / "run.csv"), "--rig", str(case / "rig.toml"), "-o", str(mcap)]
        subprocess.run(command, check=True, capture_output=True)
        effects = [f"{e}:3" if e == "viscoelastic-wall" else e for e in answers[name]["start_effects"]]
        yield f"{name}, {answers[name]['material']}", mcap, ",".join(effects) or "none"


def table(results: dict) -> str:
    lines = ["| run | effects | " + " | ".join(name for name, *_ in METHODS) + " |", "| --- | --- |" + " --- |" * len(METHODS)]
    best = {run: min(f["rmse_m"] for method in found["fits"].values() for f in method) for run, found in results.items()}
    for run, found in results.items():
        cells = []
        for name, *_ in METHODS:
            fits = found["fits"][name]
            if not fits:
                cells.append("")
                continue
            median = lambda key: statistics.median(f[key] for f in fits)  # noqa: E731
            ended = "" if all(f["converged"] for f in fits) else ", no optimum"
            cells.append(f"{median('rmse_m'):.4g} m, {median('over_noise'):.3f}×, {median('solves'):.0f}, {median('cpu'):.1f} s{ended}")
        lines.append(f"| {run} | `{found['effects']}` | " + " | ".join(cells) + " |")
    lines += ["", "| search | within 0.5% of the best | at an optimum by its own account | RMSE/noise, median | worst | solves, median | seconds, median | CPU seconds, median |", "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    for name, *_ in METHODS:
        fits = [(run, f) for run, found in results.items() for f in found["fits"][name]]
        if not fits:
            continue
        found = sum(f["rmse_m"] <= (1 + FOUND) * best[run] for run, f in fits)
        of = lambda key: [f[key] for _, f in fits]  # noqa: E731
        lines.append(
            f"| {name} | {found} of {len(fits)} ({100 * found / len(fits):.0f}%) | {sum(of('converged'))} of {len(fits)} | {statistics.median(of('over_noise')):.3f} "
            f"| {max(of('over_noise')):.2f} | {statistics.median(of('solves')):.0f} | {statistics.median(of('seconds')):.1f} | {statistics.median(of('cpu')):.1f} |"
        )
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("methods-table.md"))
    parser.add_argument("--seeds", type=int, default=5, help="most seeds of a search")
    parser.add_argument("--keep", type=Path, help="a JSON file to keep fits in, and to take those from that are there already")
    parser.add_argument("--only", nargs="+", help="fit with these searches only, and write no table")
    parser.add_argument("--budget", type=int, default=8000)
    args = parser.parse_args()
    program = str(Path(args.program).resolve())
    kept = json.loads(args.keep.read_text()) if args.keep and args.keep.exists() else {}
    results = {}
    with tempfile.TemporaryDirectory() as scratch:
        for run, recording, effects in runs(program, args.folder.resolve(), Path(scratch)):
            results[run] = {"effects": effects, "fits": {}}
            for name, options, seeds in METHODS:
                fits = []
                for seed in range(1, min(seeds, args.seeds) + 1):
                    if args.only and name not in args.only:
                        continue
                    key = f"{run} {effects} {name} {seed} {args.budget}"
                    if key not in kept:
                        kept[key] = fit((program, recording, effects, options, seed, args.budget))
                        if args.keep:
                            args.keep.write_text(json.dumps(kept))
                    fits.append(kept[key])
                results[run]["fits"][name] = fits
                print(f"{run}: {name}: {', '.join(format(f['over_noise'], '.3f') for f in fits)}", file=sys.stderr, flush=True)
    if args.only:
        return 0
    text = table(results)
    marker = "<!-- table -->"
    old = args.output.read_text() if args.output.exists() else ""
    before = old.split(marker)[0] if marker in old else "# Searches\n\n"
    args.output.write_text(f"{before}{marker}\n{text}\n")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
