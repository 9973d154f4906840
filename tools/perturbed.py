"""How much the answers depend on thresholds of unknown origin: build a copy of the program in which each is another.

perturbed.py SEED WITHIN FOLDER

Every constant of src/core/diagnose and src/core/fit whose comment says "data unknown" and whose value is one number is multiplied by
a factor between 1 / WITHIN and WITHIN, drawn evenly in its logarithm; of a number between 1 and 2, what is above 1; a whole number is rounded and not
below 1. The copy is made in FOLDER from the last commit and built there; the program is FOLDER/target/debug/surgescope. Then score it:
tools/blind.py, tools/reliability.py. A constant whose change alters no answer needs no tuning."""
import math
import random
import re
import subprocess
import sys
from pathlib import Path

CONSTANT = re.compile(r"((?:^ *///[^\n]*\n)+)(^ *pub(?:\([a-z]+\))? const (\w+): (f64|usize) = )(-?[\d.e_-]+);", re.M)


def perturbed(value, kind, factor):
    """The value times a factor."""
    if kind == "usize":
        return str(max(1, round(int(value) * factor)))
    number = float(value)
    return repr(1 + (number - 1) * factor if 1 < number < 2 else number * factor)


seed, within, folder = int(sys.argv[1]), float(sys.argv[2]), Path(sys.argv[3])
draw = random.Random(seed)
folder.mkdir(parents=True)
archive = subprocess.run(["git", "archive", "HEAD"], check=True, capture_output=True).stdout
subprocess.run(["tar", "x", "-C", folder], input=archive, check=True)
print("| constant | here | in the copy |\n| --- | --- | --- |")
for path in sorted(p for part in ("diagnose", "fit") for p in (folder / "src/core" / part).rglob("*.rs")):

    def other(found):
        comment, head, name, kind, value = found.groups()
        if "data unknown" not in re.sub(r"\s*///\s*", " ", comment):
            return found.group()
        new = perturbed(value, kind, math.exp(draw.uniform(-1, 1) * math.log(within)))
        print(f"| {name} | {value} | {new} |")
        return f"{comment}{head}{new};"

    path.write_text(CONSTANT.sub(other, path.read_text()))
subprocess.run(["cargo", "build"], cwd=folder, check=True)
