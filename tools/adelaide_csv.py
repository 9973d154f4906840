#!/usr/bin/env python3
"""Turns the digitised Adelaide trace into a time series that `surgescope import` takes.

    python3 tools/adelaide_csv.py recordings/adelaide/severe_valve_trace_reference.csv -o adelaide-severe.csv

The input is `t_s,p_gauge_kPa` under `#` comments: the curve of a printed figure, read off by a plot digitiser. The output is `time_s,P1`
in gauge kPa, every half millisecond:

- The figure's axis is absolute pressure, whatever the column is called: its second peak, published as 2057 kPa absolute, reads
  2035.4, and its cavities, at vapour pressure (1.6 kPa absolute), read -19.1 on average. The one wants 21.6 kPa added, the other 20.7.
  With 21 kPa for what the digitiser's zero is off, and less an atmosphere, that is gauge pressure.
- From 0.446 to 0.478 s the digitiser jumps six times from the cavity to 2061.8 kPa and back: a straight line printed in the
  figure, not the curve. Those points are dropped.
- Where the curve is steep the digitiser met two strokes at once and gave two pressures for one time, or stepped back. Points that ran
  backwards are put in order of time, and of points with the same time the first is kept.

What a digitiser gives are the corners of a curve, a hundred of them within a millisecond on a steep front and none for ten on a flat
stretch. As samples they would weigh the fronts alone; so the straight lines between them are read off every half millisecond, about
as fine as the curve was printed. Nothing is averaged or smoothed. Each point that was moved or dropped is listed on standard error.
"""

import argparse
import math
import sys

ZERO_KPA = 21.0  # added to what was read, to be absolute
ATMOSPHERE_KPA = 101.325
STEP_US = 500


def of_printed_line(time, pressure):
    """Whether a point lies on the straight line that the figure has beside the curve, while the cavity is open."""
    return 0.446 < time < 0.478 and pressure > 2000.0


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


def every_step(corners):
    """The straight lines between the corners, at whole steps: [(time in µs, pressure)]."""
    times, pressures = [float(c[1]) for c in corners], [float(c[2]) for c in corners]
    series, at = [], 0
    for time_us in range(STEP_US * math.ceil(times[0] * 1e6 / STEP_US), int(times[-1] * 1e6) + 1, STEP_US):
        time = time_us * 1e-6
        while times[at + 1] < time:
            at += 1
        part = (time - times[at]) / (times[at + 1] - times[at])
        series.append((time_us, pressures[at] + part * (pressures[at + 1] - pressures[at])))
    return series


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("trace", help="the digitised trace")
    parser.add_argument("-o", "--output", required=True, help="the time series to write")
    args = parser.parse_args()
    raw = points(args.trace)
    line_points = [p for p in raw if of_printed_line(float(p[1]), float(p[2]))]
    kept, moved, dropped = in_order([p for p in raw if p not in line_points])
    with open(args.output, "w", encoding="utf-8") as file:
        file.write("time_s,P1\n")
        series = every_step(kept)
        file.writelines(f"{us / 1e6:.4f},{pressure + ZERO_KPA - ATMOSPHERE_KPA:.4f}\n" for us, pressure in series)
    lists = (
        ("dropped, of a line beside the curve", line_points),
        ("put in order of time", moved),
        ("dropped, its time is taken", dropped),
    )
    for what, those in lists:
        for line, time, pressure in those:
            print(f"line {line}: {time} s, {pressure} kPa: {what}", file=sys.stderr)
    print(
        f"{len(raw)} points read, {len(moved)} put in order, {len(line_points) + len(dropped)} dropped; {len(series)} samples written "
        f"to {args.output}",
        file=sys.stderr,
    )


if __name__ == "__main__":
    main()
