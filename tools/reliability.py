"""How often a stated probability comes true: diagnose folders of recordings with one effect (or none) hidden, and count.

reliability.py PROGRAM FOLDER...: the tables of docs/src/measured/reliability.md

FOLDER as hidden_folder.py says. A case counts as a hit where the verdict, or the most probable effect where one is missing, is the truth. An
effect that leaves the start model within LEAST times the noise of what it would be without cannot be seen by anyone: such a case is
a hit, too, where the answer is that nothing is missing, and is counted apart. Seconds are those of one core. The work is a campaign in
FOLDER/reliability: one that is cut off goes on."""
import sys
from pathlib import Path

from hidden_folder import answer_of, answers, imported
from planned import done

LEAST = 1.1
BINS = [0.0, 0.5, 0.8, 0.9, 0.95, 1.0001]


def said_of(program, folder):
    """What is hidden, what the program says, and the seconds that it took."""
    place = folder / "reliability"
    cases = [{"name": case, "recordings": imported(program, folder, case, place / "recordings"),
              "effects": [answer["start_effects"] or ["none"]], "truth": answer["hidden"]["effect"]} for case, answer in answers(folder)]
    return [(task["truth"], said, seconds) for task, said, seconds in done(program, place, cases, kind="reliability")]


def judged(truth, said):
    """Truth, answer, its probability, whether it is right, whether the effect could be seen at all."""
    answer = answer_of(said)
    visible = truth == "nothing" or said["start"]["rmse_m"] > LEAST * said["start"]["noise_m"]
    right = answer == truth or (not visible and answer == "nothing")
    return truth, answer, said["probability"], right, visible


program, folders = sys.argv[1], [Path(f).resolve() for f in sys.argv[2:]]
all_cases = []
print("| recordings | cases | right | of those that can be seen | false alarms | seconds, median and worst |")
print("| --- | --- | --- | --- | --- | --- |")
for folder in folders:
    said = said_of(program, folder)
    cases = [judged(truth, found) for truth, found, _ in said]
    all_cases += cases
    nulls = [c for c in cases if c[0] == "nothing"]
    effects = [c for c in cases if c[0] != "nothing" and c[4]]
    seconds = sorted(taken for *_, taken in said)
    print(f"| {folder.name} | {len(cases)} | {sum(c[3] for c in cases)} | {sum(c[3] for c in effects)} of {len(effects)} "
          f"| {sum(c[1] != 'nothing' for c in nulls)} of {len(nulls)} | {seconds[len(seconds) // 2]:.1f}, {seconds[-1]:.1f} |")

print("\n| stated probability | cases | stated, mean | right |")
print("| --- | --- | --- | --- |")
error = 0.0
for low, high in zip(BINS, BINS[1:]):
    inside = [c for c in all_cases if low <= c[2] < high]
    if inside:
        stated, right = sum(c[2] for c in inside) / len(inside), sum(c[3] for c in inside) / len(inside)
        error += abs(stated - right) * len(inside) / len(all_cases)
        print(f"| {low:.2f} to {min(high, 1):.2f} | {len(inside)} | {stated:.3f} | {right:.3f} |")
brier = sum((c[2] - c[3]) ** 2 for c in all_cases) / len(all_cases)
print(f"\n{len(all_cases)} cases: expected calibration error {error:.3f}, Brier score {brier:.3f}.")

print("\n| hidden | right of those that can be seen | taken for |")
print("| --- | --- | --- |")
for truth in sorted({c[0] for c in all_cases}):
    seen = [c for c in all_cases if c[0] == truth and c[4]]
    wrong = sorted({c[1] for c in seen if not c[3]})
    print(f"| {truth} | {sum(c[3] for c in seen)} of {len(seen)} | {', '.join(wrong)} |")
