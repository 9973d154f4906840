"""How often the 95% intervals hold the truth: calibrate recordings whose true parameters are known, and count.

coverage.py PROGRAM FOLDER [KEEP [OPEN] [posterior=N [limit=S]]]

FOLDER as tools/hidden writes it, with `truth` in answers.json; the start effects are those of the answers, with the true number of creep
elements, or with their number left open where OPEN is `open`. The work is a campaign in the folder KEEP, FOLDER/coverage where none is given: one that
is cut off goes on. Seconds are those of one core. `off` is the root mean square of (estimate - truth) / standard error, logarithms where the interval is not symmetric: 1 where errors are what they
are said to be. An open end of an interval reaches the parameter's bound and counts as inside.

posterior=N samples each fit's posterior to N draws, too, and counts the intervals that are in doubt: those of the errors beside those of the
posteriors that converged. A recording's answer is kept in KEEP/posterior; one that is there is not sampled again. One that takes longer than S seconds is
given up, and counts as one that did not converge."""
import json
import math
import subprocess
import sys
import time
from pathlib import Path

from hidden_folder import answers, imported
from planned import done

Z = 1.959964
LINEAR = {"valve_head_m", "closure_start_s"}


def model(answer, open_number):
    """The effects that a recording was made with."""
    elements = sum(name.startswith("tau") for name in answer["truth"]["shared"])
    fixed = {"viscoelastic-wall": f"viscoelastic-wall:{elements}"} if not open_number else {}
    return [fixed.get(e, e) for e in answer["start_effects"]] or ["none"]


def said_of(program, folder, keep, open_number):
    cases = [{"name": case, "recordings": imported(program, folder, case, keep / "recordings"), "effects": [model(answer, open_number)]}
             for case, answer in answers(folder)]
    return [{"case": task["case"], "s": seconds, "said": said} for task, said, seconds in done(program, keep, cases, kind="calibrate")]


def sampled(program, folder, keep, open_number, wanted, limit):
    """The fit of each recording with its posterior, and the seconds of both; nothing said where it was given up."""
    place = keep / "posterior"
    place.mkdir(parents=True, exist_ok=True)
    for case, answer in answers(folder):
        kept = place / f"{case}.json"
        if not kept.exists():
            recordings, began = imported(program, folder, case, keep / "recordings"), time.monotonic()
            words = [program, "calibrate", *recordings, "--effects", ",".join(model(answer, open_number)), "--posterior", wanted, "--json"]
            try:
                ended = subprocess.run(words, capture_output=True, text=True, timeout=limit)
                if not ended.stdout:
                    raise SystemExit(f"{case}: {ended.stderr}")
                said = json.loads(ended.stdout)
            except subprocess.TimeoutExpired:
                said = {}
            kept.write_text(json.dumps({"case": case, "s": time.monotonic() - began, "said": said}))
        yield json.loads(kept.read_text())


def in_doubt(fits, linear, truths):
    """Prints how often the intervals that are in doubt hold the truth, by kind of doubt: those of the errors, and of the posteriors."""
    linear = {s["case"]: s for s in linear}
    met = [s for s in fits if (s["said"].get("posterior") or {}).get("converged")]
    rows = []
    for s in met:
        held = lambda said: {(r[1], r[8]): r[2] for r in judged(said, truths[s["case"]])}
        before = held(linear[s["case"]])
        rows += [(r[9], before[r[1], r[8]], r[2]) for r in judged(s, truths[s["case"]]) if r[9]]
    print("\n| in doubt | intervals | of errors hold the truth | of posteriors hold it |\n| --- | --- | --- | --- |")
    for doubt in [*sorted({r[0] for r in rows}), "all"]:
        own = [r for r in rows if doubt in ("all", r[0])]
        share = lambda k: f"{sum(r[k] for r in own)} ({100 * sum(r[k] for r in own) / max(1, len(own)):.0f}%)"
        print(f"| {doubt} | {len(own)} | {share(1)} | {share(2)} |")
    more = sorted(s["said"]["evaluations"] - linear[s["case"]]["said"]["evaluations"] for s in fits if s["said"]) or [0]
    seconds = sorted(s["s"] for s in fits)
    given_up = sum(not s["said"] for s in fits)
    print(f"\n{len(met)} of {len(fits)} posteriors converged, {given_up} were given up; {more[len(more) // 2]} simulations median, {more[-1]} most; "
          f"{seconds[len(seconds) // 2]:.1f} s median with the fit, {seconds[-1]:.1f} s worst.")


def kind(name):
    return name.rstrip("]").split("[")[0] if "[" in name else name


def interval(p):
    """The program's, or the linear one where it says none."""
    if "interval_95" in p:
        low, high = p["interval_95"] or (None, None)
        return (-math.inf if low is None else low), (math.inf if high is None else high)
    if p["standard_error"] is None:
        return -math.inf, math.inf
    return p["value"] - Z * p["standard_error"], p["value"] + Z * p["standard_error"]


def judged(said, answer):
    """A row for each parameter whose truth is known: whether inside, estimate - truth in standard errors, and more."""
    truth, found = answer["truth"], said["said"]["parameters"]
    elements = lambda names: sum(n.startswith("tau") for n in names)
    same = elements(truth["shared"]) == elements(p["name"] for p in found)
    for p in found:
        run = truth["runs"].get(Path(p["run"]).stem.removeprefix(said["case"] + "-")) if p.get("run") else truth["shared"]
        exact = run.get(p["name"])
        if exact is None or (not same and p["name"][:3] in ("tau", "J1_", "J2_", "J3_")):
            continue
        low, high = interval(p)
        error = p["standard_error"]
        if not error:
            off = math.nan
        elif p["name"] in LINEAR:
            off = (p["value"] - exact) / error
        else:
            off = math.log(p["value"] / exact) * p["value"] / error
        yield said["case"], p["name"], low <= exact <= high, off, p["at_bound"], p["value"], exact, error, p.get("run"), p.get("doubt")
    yield from creep(said, answer)


def creep_of(names, values, t):
    """J(t) of the elements among named values, and its slope by the logarithm of each value."""
    total, slopes = 0.0, [0.0] * len(names)
    for i, name in enumerate(names):
        if name.startswith("tau"):
            j = names.index(f"J{name[3:-2]}_per_GPa")
            gone = math.exp(-t / values[i])
            total += values[j] * (1 - gone)
            slopes[j] = values[j] * (1 - gone)
            slopes[i] = -values[j] * gone * t / values[i]
    return total, slopes


def creep(said, answer):
    """Rows of the creep J(t), which does not ask how many elements there are, at times from the closing time to a tenth of the record."""
    truth, found = answer["truth"]["shared"], said["said"]["parameters"]
    names, values = [p["name"] for p in found], [p["value"] for p in found]
    if not any(n.startswith("tau") for n in truth):
        return
    first, last = answer["truth"]["runs"]["run"]["closing_time_s"], said["said"]["runs"][0]["duration_s"] / 10
    for k in range(4):
        t = first * (last / first) ** (k / 3)
        exact, _ = creep_of(list(truth), list(truth.values()), t)
        value, slopes = creep_of(names, values, t)
        moved = [i for i, slope in enumerate(slopes) if slope]
        if not moved or any(not found[i]["standard_error"] for i in moved):
            yield said["case"], f"J(t), {k + 1} of 4", True, math.nan, False, value, exact, None, None, None
            continue
        share = [slopes[i] * found[i]["standard_error"] / values[i] for i in moved]
        error = math.sqrt(sum(share[a] * share[b] * found[i]["correlation"][j]
                              for a, i in enumerate(moved) for b, j in enumerate(moved)))
        off = (value - exact) / error
        yield said["case"], f"J(t), {k + 1} of 4", abs(off) <= Z, off, False, value, exact, error, None, None


def lacking(said):
    """Whether the program says that its intervals are too narrow."""
    return any("lower bounds" in warning for warning in said["said"]["warnings"])


def held_or_warned(said, truths):
    """Of wave speed and creep: in how many recordings all intervals hold the truth, and in how many of the others the program warns."""
    held = warned = 0
    for s in said:
        rows = [r for r in judged(s, truths[s["case"]]) if r[1] == "wave_speed_m_s" or r[1].startswith("J(t)")]
        good = all(r[2] for r in rows)
        held += good
        warned += not good and lacking(s)
    return f"Wave speed and creep: {held} of {len(said)} recordings hold the truth in all intervals, {warned} of the others warn."


def table(rows):
    print("| parameter | intervals | hold the truth | off, rms | off, median of the size | at a bound |")
    print("| --- | --- | --- | --- | --- | --- |")
    names = sorted({r[1] for r in rows})
    for name in [*names, "all"]:
        own = [r for r in rows if name in ("all", r[1])]
        offs = sorted(abs(r[3]) for r in own if math.isfinite(r[3]))
        rms = math.sqrt(sum(o * o for o in offs) / max(1, len(offs)))
        inside = sum(r[2] for r in own)
        print(f"| {name} | {len(own)} | {inside} ({100 * inside / len(own):.0f}%) | {rms:.2f} "
              f"| {offs[len(offs) // 2] if offs else math.nan:.2f} | {sum(r[4] for r in own)} |")


def main():
    program, folder = sys.argv[1], Path(sys.argv[2]).resolve()
    open_number = "open" in sys.argv[4:]
    keep = Path(sys.argv[3]).resolve() if len(sys.argv) > 3 else folder / "coverage"
    said = said_of(program, folder, keep, open_number)
    truths = dict(answers(folder))
    rows = [row for s in said for row in judged(s, truths[s["case"]])]
    table(rows)
    print("\n" + held_or_warned(said, truths))
    seconds = sorted(s["s"] for s in said)
    print(f"\n{len(said)} recordings; {seconds[len(seconds) // 2]:.1f} s median, {seconds[-1]:.1f} s worst.")
    given = dict(word.split("=") for word in sys.argv[4:] if "=" in word)
    if "posterior" in given:
        limit = float(given["limit"]) if "limit" in given else None
        in_doubt(list(sampled(program, folder, keep, open_number, given["posterior"], limit)), said, truths)
    if "misses" in sys.argv[4:]:
        for r in rows:
            if not r[2]:
                print(r)
        for s in said:
            f = s["said"]
            print(s["case"], f"{s['s']:.1f} s", " ".join(f"{r['rmse_m'] / r['noise_m']:.4f}" for r in f["runs"]), f["effects"])


main()
