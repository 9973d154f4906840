"""Break a sensor in each of a folder's recordings, in each way, and count how often the fault is named.

faults.py PROGRAM FOLDER...: prints a Markdown table. Every FOLDER holds folders with a rig.toml and tables run*.csv. Of each table one
pressure sensor is broken, chosen by turns. What is not named is diagnosed: a fault that passes for a physical effect counts as sold."""
import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

FAULTS = ["flat", "stuck", "clipped", "inverted", "swapped", "wrong-unit", "wrong-time-unit"]


def sensors(rig):
    import tomllib
    return [s["name"] for s in tomllib.loads(rig.read_text())["sensor"] if s["kind"] == "pressure"]


def broken(rows, heading, name, other, fault):
    """The rows with a fault in the column of that name."""
    at = heading.index(name)
    seen = [(i, float(row[at])) for i, row in enumerate(rows) if row[at]]
    values = [v for _, v in seen]
    low, high = min(values), max(values)
    top = max(range(len(values)), key=lambda k: values[k])
    rows = [list(row) for row in rows]
    for k, (i, value) in enumerate(seen):
        if fault == "flat":
            rows[i][at] = "300"
        elif fault == "stuck" and k > top + 10:
            rows[i][at] = rows[seen[top + 10][0]][at]
        elif fault == "clipped":
            rows[i][at] = repr(min(value, low + 0.6 * (high - low)))
        elif fault == "inverted":
            rows[i][at] = repr(-value)
        elif fault == "wrong-unit":
            rows[i][at] = repr(value * 0.01)
    for row in rows:
        if fault == "swapped":
            there = heading.index(other)
            row[at], row[there] = row[there], row[at]
        elif fault == "wrong-time-unit":
            row[0] = repr(float(row[0]) * 1000)
    return rows


def run(program, *arguments):
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)


def main():
    program, folders = sys.argv[1], sys.argv[2:]
    named, tried, sold, missed = dict.fromkeys(FAULTS, 0), dict.fromkeys(FAULTS, 0), dict.fromkeys(FAULTS, 0), []
    false_alarms = tables = 0
    with tempfile.TemporaryDirectory() as work:
        work = Path(work)
        files = sorted(file for folder in folders for file in Path(folder).glob("*/run*.csv"))
        for number, file in enumerate(files):
            rig = file.parent / "rig.toml"
            with file.open() as lines:
                heading, *rows = [row for row in csv.reader(lines) if not row[0].startswith("#")]
            names = [name for name in sensors(rig) if name in heading]
            for fault in ["none", *FAULTS]:
                if fault == "swapped" and len(names) < 2:
                    continue
                name = names[number % len(names)]
                other = names[(number + 1) % len(names)]
                table, recording = work / "run.csv", work / "run.mcap"
                recording.unlink(missing_ok=True)
                with table.open("w") as out:
                    csv.writer(out).writerows([heading, *broken(rows, heading, name, other, fault)])
                done = run(program, "import", table, "--rig", rig, "-o", recording, "--json")
                if done.returncode != 0:
                    missed.append(f"{file.parent.name}/{file.name} {name} {fault}: {done.stderr.strip()[:200]}")
                    tried[fault] = tried.get(fault, 0) + 1
                    continue
                faults = [f for f in json.loads(done.stdout)["sensor_faults"] if f["fault"] != "coarse"]
                if fault == "none":
                    tables += 1
                    false_alarms += bool(faults)
                    if faults:
                        missed.append(f"{file.parent.name}/{file.name} sound: {faults}")
                    continue
                tried[fault] += 1
                if any(f["sensor"] == name and f["fault"] == fault for f in faults):
                    named[fault] += 1
                    continue
                missed.append(f"{file.parent.name}/{file.name} {name} {fault}: {faults}")
                if not faults:
                    diagnosed = run(program, "diagnose", recording, "--json")
                    if diagnosed.returncode == 0:
                        found = json.loads(diagnosed.stdout)
                        if found["verdict"] == "missing-effect" and found["probability"] > 0.3:
                            sold[fault] += 1
                            missed[-1] += f" sold as {found['candidates'][0]['effect']} {found['probability']:.2f}"
    print("| fault | tried | named as what it is | sold as an effect |\n| --- | --- | --- | --- |")
    for fault in FAULTS:
        print(f"| {fault} | {tried[fault]} | {named[fault]} | {sold[fault]} |")
    print(f"\nFalse alarms: {false_alarms} of {tables} sound tables.")
    print("\n".join(missed), file=sys.stderr)


main()
