#!/usr/bin/env python3
"""Prints the licences of everything that is part of the program: uPlot and all packages that it is linked from.

    python3 tools/third_party.py > third-party-licences.txt
"""

import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
UPLOT = ROOT / "src/report/html/assets/uplot/LICENSE"


def cargo(*arguments):
    return subprocess.run(["cargo", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def linked():
    """Name and version of each package that is linked."""
    tree = cargo("tree", "--locked", "--package", "surgescope", "--edges", "normal", "--prefix", "none", "--format", "{p}")
    named = (line.split() for line in tree.splitlines() if line)
    return {(words[0], words[1].lstrip("v")) for words in named}


def texts(folder):
    """The licence files of a package, those of C sources below it included."""
    names = ("LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE")
    files = [*folder.glob("*"), *folder.glob("*/*")]
    return [f for f in sorted(files) if f.is_file() and f.name.upper().startswith(names)]


def main():
    wanted = linked()
    packages = json.loads(cargo("metadata", "--locked", "--format-version", "1"))["packages"]
    packages = [p for p in packages if (p["name"], p["version"]) in wanted and p["source"]]
    holders = defaultdict(list)
    holders[UPLOT.read_text()].append("uPlot (draws the charts of report pages)")
    print("surgescope contains these works. Their licences follow.\n")
    print("uPlot: MIT")
    for package in sorted(packages, key=lambda p: (p["name"], p["version"])):
        name = f"{package['name']} {package['version']}"
        print(f"{name}: {package['license'] or 'see below'}")
        for file in texts(Path(package["manifest_path"]).parent):
            holders[file.read_text(errors="replace").strip()].append(name)
    for text, names in holders.items():
        print(f"\n{'-' * 80}\n{', '.join(dict.fromkeys(names))}\n{'-' * 80}\n\n{text}")


if __name__ == "__main__":
    sys.exit(main())
