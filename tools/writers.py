"""Kill every command that writes at a random moment, and let it run on a full disk: the old file or the new one is there, whole.

writers.py PROGRAM [TIMES] [FOLDER]: prints a Markdown table. FOLDER lies on a small disk of its own, which is filled; without one only kills
are tried. On Linux as root: mount -t tmpfs -o size=32m small FOLDER."""
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RECORDING = ROOT / "recordings" / "hdpe-nothing-missing.mcap"
CREEP = ROOT / "recordings" / "hdpe-creep.mcap"
RIG = ROOT / "rigs" / "demo-hdpe.toml"
SHOT = ["record", "--rig", RIG, "--simulate", "--speed", 0, "--duration", 8]


def toml(path):
    import tomllib
    return bool(tomllib.loads(path.read_text()))


def html(path):
    return path.read_text().rstrip().endswith("</html>")


def svg(path):
    return path.read_text().rstrip().endswith("</svg>")


class Writer:
    """A command that writes a file, and how to see that it is whole. `replaces` where it may stand in the place of an older one."""

    def __init__(self, name, target, arguments, whole, replaces):
        self.name, self.target, self.arguments, self.whole, self.replaces = name, target, arguments, whole, replaces


def writers(program, made):
    runs, csv_of = made / "runs", made / "run.csv"
    calibrate = ["calibrate", RECORDING, "--effects", "none", "--against", "none", "--most-reaches", 16]

    def mcap(path):
        return subprocess.run([program, "export", path, "-o", "/dev/stdout"], capture_output=True).returncode in (0, 2) and \
            b"MCAP0" in path.read_bytes()[-8:]

    def lines(path):
        return path.read_text().endswith("\n") and len({line.count(",") for line in path.read_text().splitlines()}) == 1

    def index(path):
            return sqlite3.connect(path).execute("pragma integrity_check").fetchone() == ("ok",)

    return [
        Writer("report", "page.html", [*calibrate, "--report", "page.html"], html, True),
        Writer("chart of runs", "chart.svg", ["history", "--folder", runs, "--svg", "chart.svg"], svg, True),
        Writer("table of runs", "table.csv", ["history", "--folder", runs, "--csv", "table.csv"], lines, True),
        Writer("simulated table", "s.csv", ["simulate", "--rig", RIG, "--set", "initial_velocity_m_s=0.5", "--duration", 40, "-o", "s.csv"],
               lines, True),
        Writer("fit", "fit.toml", [*calibrate, "-o", "fit.toml", "--overwrite"], toml, True),
        Writer("models", "m.toml", [*calibrate, "--save", "m.toml"], toml, True),
        Writer("import", "i.mcap", ["import", csv_of, "--rig", made / "rig.toml", "-o", "i.mcap"], mcap, False),
        Writer("export", "e.csv", ["export", RECORDING, "-o", "e.csv"], lines, False),
        Writer("recovery", "r.mcap", ["recover", RECORDING, "-o", "r.mcap"], mcap, False),
        Writer("added effect", "grown.toml", ["add", "supply-drift", "grown.toml"], toml, True),
        Writer("applied diagnosis", "diagnosed.toml", ["diagnose", CREEP, "--apply", "diagnosed.toml", "--most-reaches", 8], toml, True),
        Writer("index", "surgescope.sqlite", ["watch", ".", "--once", "--effects", "none"], index, True),
    ]


def main():
    program = PROGRAM
    times = int(sys.argv[2]) if len(sys.argv) > 2 else 50
    small = Path(sys.argv[3]) if len(sys.argv) > 3 else None
    dice = random.Random(1)
    print("| writer | kills | old file | new file | torn | left behind after the next run | full disks | old | new | torn |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as work:
        work = Path(work)
        made = work / "made"
        (made / "runs").mkdir(parents=True)
        shutil.copy(RECORDING, made / "runs" / "run.mcap")
        run = lambda *a: subprocess.run([program, *map(str, a)], capture_output=True, check=True)
        run("export", RECORDING, "-o", made / "run.csv")
        run("watch", made / "runs", "--once", "--effects", "none")
        (made / "rig.toml").write_text(rig_of(RECORDING))
        for writer in writers(program, made):
            cells = [writer.name, times, *killed(program, writer, work / "kill", times, dice)]
            cells += full(program, writer, small, times) if small else ["–"] * 4
            print("| " + " | ".join(map(str, cells)) + " |", flush=True)


        print()
        print("| command over a folder of recordings | kills | recordings in the end | fits, models and pages torn | recordings lost | entries of the index |")
        print("| --- | --- | --- | --- | --- | --- |")
        for name, arguments in [
            ("`record --calibrate`", lambda n: [*SHOT, "--calibrate", "-o", f"{n}.mcap"]),
            ("`watch`", lambda n: ["watch", "."]),
        ]:
            print("| " + " | ".join(map(str, [name, times, *killed_in_folder(program, arguments, work / "folder", times, dice)])) + " |", flush=True)


def killed_in_folder(program, arguments, folder, times, dice):
    """Kill a command that adds to a folder, which is then completed by `recover` and `watch --once`. What is torn, lost, or twice in the index."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    watches = arguments(0)[0] == "watch"
    torn = 0
    for n in range(times):
        if watches:
            # a copy would be known as the same run
            subprocess.run([program, *map(str, SHOT), "--note", f"number={n}", "-o", folder / f"{n}.mcap"], capture_output=True, check=True)
        command = [program, *map(str, arguments(n))]
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(dice.uniform(0, 4 if watches else 1.6))
        process.send_signal(signal.SIGKILL)
        process.wait()
        torn += sum(not WHOLE[f.suffix](f) for f in folder.iterdir() if f.suffix in WHOLE and not f.name.startswith("."))
    recordings, lost = 0, 0
    for f in sorted(folder.glob("*.mcap")):
        if f.read_bytes()[-8:] != b"\x89MCAP0\r\n":
            whole = folder / f"recovered-{f.name}"
            subprocess.run([program, "recover", f, "-o", whole], cwd=folder, capture_output=True)
            if not whole.exists():
                # the first chunk is written after a second at the latest; before it there is nothing to recover
                lost += f.stat().st_size > 65536
                f.unlink()
                continue
            f.unlink()
        recordings += 1
    lost += watches and recordings != times
    subprocess.run([program, "watch", ".", "--once"], cwd=folder, capture_output=True)
    index = sqlite3.connect(folder / "surgescope.sqlite")
    entries = dict(index.execute("select state, count(*) from run group by state"))
    return [recordings, torn, lost, entries]


def rig_of(recording):
    """The rig file inside a recording: the attachment of that name."""
    data = recording.read_bytes()
    at = 8
    while True:
        opcode, length = data[at], int.from_bytes(data[at + 1 : at + 9], "little")
        body = data[at + 9 : at + 9 + length]
        if opcode == 0x09:
            place = 16
            for _ in range(2):
                place += 4 + int.from_bytes(body[place : place + 4], "little")
            size = int.from_bytes(body[place : place + 8], "little")
            return body[place + 8 : place + 8 + size].decode()
        at += 9 + length


def fresh(writer, folder):
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    if writer.name == "index":
        shutil.copy(RECORDING, folder / "run.mcap")
    if writer.target in START:
        start = ["calibrate", START[writer.target], "--effects", "none", "--against", "none", "--most-reaches", 8, "--save", folder / writer.target]
        subprocess.run([PROGRAM, *map(str, start)], capture_output=True, check=True)


PROGRAM = Path(sys.argv[1]).resolve()
WHOLE = {".toml": toml, ".html": html}
# the model files to which an effect is added each time, and what they are of
START = {"grown.toml": RECORDING, "diagnosed.toml": CREEP}
MARKS = {".html": b"\n<!-- old -->", ".svg": b"\n<!-- old -->", ".toml": b"\n# old\n", ".csv": b""}


def aged(writer, target):
    """An older file in the target's place, told from a new one by its bytes; none where none may be there."""
    if not writer.replaces:
        target.unlink(missing_ok=True)
        return None
    if target.suffix == ".sqlite" or writer.name == "models":
        return target.read_bytes()
    if target.name in START:
        # each time the model of the beginning, to which an effect can be added
        first = target.with_suffix(".first")
        if not first.exists():
            fresh(writer, target.parent)
            shutil.copy(target, first)
        shutil.copy(first, target)
        return target.read_bytes()
    content = target.read_bytes().split(b"\n<!-- old")[0].split(b"\n# old")[0]
    # a table of fewer rows
    old = content + MARKS[target.suffix] if MARKS[target.suffix] else b"\n".join(content.split(b"\n")[:2]) + b"\n"
    target.write_bytes(old)
    return old


def state(writer, target, old):
    if not target.exists():
        return "old" if old is None else "torn"
    if old is not None and target.read_bytes() == old:
        return "old"
    try:
        return "new" if writer.whole(target) else "torn"
    except Exception:
        return "torn"


def killed(program, writer, folder, times, dice):
    command = [program, *map(str, writer.arguments)]
    fresh(writer, folder)
    began = time.time()
    subprocess.run(command, cwd=folder, capture_output=True)
    took = time.time() - began
    seen = {"old": 0, "new": 0, "torn": 0}
    for _ in range(times):
        old = aged(writer, folder / writer.target)
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        # most of the time of a command goes into its computation: half of the kills fall into its last fifth
        time.sleep(took * (dice.uniform(0, 1.05) if dice.random() < 0.5 else dice.uniform(0.8, 1.05)))
        process.send_signal(signal.SIGKILL)
        process.wait()
        seen[state(writer, folder / writer.target, old)] += 1
        if seen["torn"]:
            break
    for left in folder.glob(".*.tmp"):
        os.utime(left, (time.time() - 60,) * 2)
    if not writer.replaces:
        (folder / writer.target).unlink(missing_ok=True)
    subprocess.run(command, cwd=folder, capture_output=True)
    return [seen["old"], seen["new"], seen["torn"], len(list(folder.glob(".*.tmp")))]


def full(program, writer, small, times):
    command = [program, *map(str, writer.arguments)]
    seen = {"old": 0, "new": 0, "torn": 0}
    fresh(writer, small / "w")
    subprocess.run(command, cwd=small / "w", capture_output=True)
    need = sum(f.stat().st_size for f in (small / "w").iterdir() if f.name != "run.mcap")
    for turn in range(times):
        filler = small / "filler"
        old = aged(writer, small / "w" / writer.target)
        for left in (small / "w").glob(".*.tmp"):
            left.unlink()
        disk = os.statvfs(small)
        free = disk.f_bavail * disk.f_frsize
        keep = int(1.3 * need * turn / times)
        with filler.open("wb") as out:
            out.write(bytes(max(0, free - keep)))
        subprocess.run(command, cwd=small / "w", capture_output=True)
        filler.unlink()
        seen[state(writer, small / "w" / writer.target, old)] += 1
    return [times, seen["old"], seen["new"], seen["torn"]]


main()
