#!/usr/bin/env python3
"""The searches that a calibration knows, side by side on ten runs; writes a table in Markdown.

    cargo build --release
    cargo run --release -p surgescope-tools --bin hidden_effects -- 11 9 FOLDER nothing
    python3 tools/methods.py target/release/surgescope FOLDER -o docs/src/measured/methods.md

Ten runs: the three of recordings/ and seven of FOLDER, each with the effects that it was made with. A run's best error is the least that any search found,
of any seed. Least squares with random starts runs with five seeds, population searches with two; what draws nothing runs once. Each search is a campaign in
FOLDER/methods: one that is cut off goes on. Seconds are those of one core.
"""

import argparse
import json
import statistics
import sys
from pathlib import Path

from hidden_folder import imported
from planned import done

ROOT = Path(__file__).resolve().parent.parent
SHIPPED = [
    ("hdpe-creep", "viscoelastic-wall:3"),
    ("hdpe-nothing-missing", "viscoelastic-wall:3"),
    ("copper-leak", "unsteady-friction,leak"),
]
DRAWN = ["case-001", "case-002", "case-003", "case-004", "case-006", "case-007", "case-009"]
# Name, method, random starts, seeds.
METHODS = [
    ("stepwise", "stepwise", 0, 1),
    ("least squares", "least-squares", 0, 1),
    ("least squares, 8 more starts", "least-squares", 8, 5),
    ("global", "global", 0, 2),
    ("micro-GA", "micro-ga", 0, 2),
    ("global-local", "global-local", 0, 2),
]
FOUND = 0.005


def runs(program: str, folder: Path) -> list:
    """Name, recording and effects of each run."""
    answers = json.loads((folder / "answers.json").read_text())
    chosen = [(name, ROOT / "recordings" / f"{name}.mcap", effects) for name, effects in SHIPPED]
    for name in DRAWN:
        recording = imported(program, folder, name, folder / "methods/recordings")[0]
        effects = [f"{e}:3" if e == "viscoelastic-wall" else e for e in answers[name]["start_effects"]]
        chosen.append((f"{name}, {answers[name]['material']}", recording, ",".join(effects) or "none"))
    return chosen


def fits(program: str, place: Path, chosen: list, search: tuple, budget: int) -> dict:
    """The fits of each run by one search."""
    name, method, starts, seeds = search
    cases = [{"name": run, "recordings": [str(recording)], "effects": [effects.split(",")]} for run, recording, effects in chosen]
    tasks = done(program, place / name.replace(" ", "-"), cases, {"random_starts": starts, "budget": budget}, kind="calibrate", methods=[method], starts=seeds)
    found = {run: [] for run, *_ in chosen}
    for task, fit, seconds in tasks:
        run = fit["runs"][0]
        found[task["case"]].append({
            "rmse_m": run["rmse_m"],
            "over_noise": run["rmse_m"] / run["noise_m"],
            "converged": fit["converged"],
            "solves": fit["evaluations"],
            "seconds": seconds,
        })
    return found


def table(results: dict) -> str:
    lines = ["| run | effects | " + " | ".join(name for name, *_ in METHODS) + " |", "| --- | --- |" + " --- |" * len(METHODS)]
    best = {run: min(f["rmse_m"] for method in found["fits"].values() for f in method) for run, found in results.items()}
    for run, found in results.items():
        cells = []
        for name, *_ in METHODS:
            fits = found["fits"][name]
            median = lambda key: statistics.median(f[key] for f in fits)  # noqa: E731
            ended = "" if all(f["converged"] for f in fits) else ", no optimum"
            cells.append(f"{median('rmse_m'):.4g} m, {median('over_noise'):.3f}×, {median('solves'):.0f}, {median('seconds'):.1f} s{ended}")
        lines.append(f"| {run} | `{found['effects']}` | " + " | ".join(cells) + " |")
    lines += ["", "| search | within 0.5% of the best | at an optimum by its own account | RMSE/noise, median | worst | solves, median | seconds of one core, median |", "| --- | --- | --- | --- | --- | --- | --- |"]
    for name, *_ in METHODS:
        fits = [(run, f) for run, found in results.items() for f in found["fits"][name]]
        found = sum(f["rmse_m"] <= (1 + FOUND) * best[run] for run, f in fits)
        of = lambda key: [f[key] for _, f in fits]  # noqa: E731
        lines.append(
            f"| {name} | {found} of {len(fits)} ({100 * found / len(fits):.0f}%) | {sum(of('converged'))} of {len(fits)} | {statistics.median(of('over_noise')):.3f} "
            f"| {max(of('over_noise')):.2f} | {statistics.median(of('solves')):.0f} | {statistics.median(of('seconds')):.1f} |"
        )
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("methods-table.md"))
    parser.add_argument("--seeds", type=int, default=5, help="most seeds of a search")
    parser.add_argument("--keep", type=Path, help="folder of the campaigns [default: FOLDER/methods]")
    parser.add_argument("--only", nargs="+", help="fit with these searches only, and write no table")
    parser.add_argument("--budget", type=int, default=8000)
    args = parser.parse_args()
    program, folder = str(Path(args.program).resolve()), args.folder.resolve()
    chosen = runs(program, folder)
    results = {run: {"effects": effects, "fits": {}} for run, _, effects in chosen}
    for name, method, starts, seeds in METHODS:
        if args.only and name not in args.only:
            continue
        search = (name, method, starts, min(seeds, args.seeds))
        for run, found in fits(program, (args.keep or folder / "methods").resolve(), chosen, search, args.budget).items():
            results[run]["fits"][name] = found
            print(f"{run}: {name}: {', '.join(format(f['over_noise'], '.3f') for f in found)}", file=sys.stderr, flush=True)
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
