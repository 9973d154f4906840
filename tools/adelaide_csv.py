#!/usr/bin/env python3
"""Turns the digitised Adelaide trace into a time series that `surgescope import` takes.

    python3 tools/adelaide_csv.py recordings/adelaide/severe_valve_trace_reference.csv -o adelaide-severe.csv

The input is `t_s,p_gauge_kPa` under `#` comments: the curve of a printed figure, read off by a plot digitiser. Where the curve is
steep the digitiser met two strokes at once and gave two pressures for one time, or stepped back. The output is `time_s,P1` (gauge kPa, as
read) with strictly increasing times: points that ran backwards are put in order of time, and of points with the same time the first
is kept. Nothing is averaged, smoothed or shifted. Each point that was moved or dropped is listed on standard error.
"""

import argparse
import sys


def points(path):
    """[(line, time text, pressure text)] in the order of the file."""
    found = []
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, start=1):
            line = line.strip()
            if not line or line.startswith(("#", "t_s")):
                continue
            cells = line.split(",")
            try:
                time, pressure = cells
                float(time), float(pressure)
            except ValueError:
                sys.exit(f"{path}:{number}: expected 't_s,p_gauge_kPa', found '{line}'")
            found.append((number, time, pressure))
    return found


def in_order(raw):
    """The points with strictly increasing times, those that were moved, and those that were dropped."""
    latest, moved = float("-inf"), []
    for point in raw:
        if float(point[1]) < latest:
            moved.append(point)
        latest = max(latest, float(point[1]))
    kept, dropped = [], []
    for point in sorted(raw, key=lambda p: float(p[1])):  # stable: of equal times the first of the file comes first
        if kept and float(point[1]) == float(kept[-1][1]):
            dropped.append(point)
        else:
            kept.append(point)
    return kept, moved, dropped


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("trace", help="the digitised trace")
    parser.add_argument("-o", "--output", required=True, help="the time series to write")
    args = parser.parse_args()
    raw = points(args.trace)
    kept, moved, dropped = in_order(raw)
    with open(args.output, "w", encoding="utf-8") as file:
        file.write("time_s,P1\n")
        file.writelines(f"{time},{pressure}\n" for _, time, pressure in kept)
    for what, those in (("put in order of time", moved), ("dropped, its time is taken", dropped)):
        for line, time, pressure in those:
            print(f"line {line}: {time} s, {pressure} kPa: {what}", file=sys.stderr)
    print(
        f"{len(raw)} points read, {len(moved)} put in order, {len(dropped)} dropped, {len(kept)} written to {args.output}",
        file=sys.stderr,
    )


if __name__ == "__main__":
    main()
