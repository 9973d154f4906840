#!/usr/bin/env python3
"""The calibration of one run with numpy and scipy, beside the program: the same model, the same start, the same samples, in one run.

Elastic pipe with quasi-steady friction and two Kelvin-Voigt elements by the method of characteristics, all nodes of a time step at once in
numpy; wave speed, J, tau, velocity, head, closing time and start, friction and one offset a sensor fitted by scipy's `least_squares` (trust
region reflective, bounds, differences of two points) to the CSV that `surgescope export` writes. The grid is the one that the program's own fit
ends on; what is known beforehand (meter, sensors' zero, friction near the pipe's own) enters as residuals with the program's standard deviations.

    cargo build --release && tools/peers/scipy_fit.py [--python VENV/bin/python] [--recording MCAP] [--turns N]

Each side runs as a process of its own, on whatever cores it takes; the program takes several turns and counts its best and its median. Exits with 1
where the two errors differ by more than 2%, or the ratio falls under 50. Needs numpy and scipy (`pip install numpy scipy`).
"""

import argparse
import json
import math
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
GRAVITY = 9.81
BAR = 50.0
# The grid that the program's fit of the shipped recordings ends on.
REACHES = 128
SAME = 0.02
PASCAL = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "bar": 1e5}
M3_S = {"m3/s": 1.0, "m3/h": 1 / 3600, "L/s": 1e-3, "L/min": 1e-3 / 60}


def water(degc: float) -> tuple[float, float]:
    """Density, kg/m3, of Kell (1975), and kinematic viscosity, m2/s, of Kestin, Sokolov & Wakeham (1978)."""
    t = degc
    density = (
        999.83952 + 16.945176 * t - 7.9870401e-3 * t**2 - 46.170461e-6 * t**3 + 105.56302e-9 * t**4 - 280.54253e-12 * t**5
    ) / (1 + 16.879850e-3 * t)
    power = (20 - t) / (t + 96) * (1.2378 - 1.303e-3 * (20 - t) + 3.06e-6 * (20 - t) ** 2 + 2.55e-8 * (20 - t) ** 3)
    return density, 1.002e-3 * 10**power / density


class Run:
    """A recording's CSV and rig as arrays in SI units."""

    def __init__(self, csv_text: str, rig: dict, numpy):
        header, *lines = csv_text.splitlines()
        names = header.split(",")
        columns = list(zip(*(line.split(",") for line in lines)))
        time_s = numpy.array(columns[0], dtype=float)
        self.pipe = rig["pipe"][0]
        assert len(rig["pipe"]) == 1, "one pipe only"
        self.valve = rig["downstream"]
        sensors = {s["name"]: s for s in rig["sensor"]}

        def series(kind: str):
            for name, column in zip(names[1:], columns[1:]):
                if sensors[name]["kind"] == kind:
                    kept = [i for i, cell in enumerate(column) if cell]
                    yield sensors[name], time_s[kept], numpy.array([float(column[i]) for i in kept])

        temperatures = [values.mean() for _, _, values in series("temperature")]
        self.constraint = self.pipe.get("constraint", 1.0)
        assert isinstance(self.constraint, float), "the constraint as a number only"
        self.density, self.viscosity = water(temperatures[0] if temperatures else rig["fluid"]["temperature_degC"])
        per_m = self.density * GRAVITY
        # Times and heads of each pressure sensor, and what its zero is known to: a hundredth of the rise, as no accuracy is stated.
        self.pressures = []
        for sensor, t, values in series("pressure"):
            heads = values * PASCAL[sensor["unit"]] / per_m
            self.pressures.append((sensor["position_m"], t, heads, 0.01 * float(heads.max() - heads[:20].mean())))
        self.flows = [(t, values * M3_S[s["unit"]]) for s, t, values in series("flow")]


def friction(run: Run, velocity: float) -> tuple[float, float]:
    """Head lost per metre is `linear Q + square Q|Q|`: laminar below 2320, else a smooth pipe's (Colebrook & White) at the flow before the closure."""
    diameter = run.pipe["inner_diameter_mm"] / 1e3
    area = math.pi / 4 * diameter**2
    if "friction_factor" in run.pipe:
        factor = run.pipe["friction_factor"]
    else:
        reynolds = velocity * diameter / run.viscosity
        if reynolds < 2320:
            return 32 * run.viscosity / (GRAVITY * diameter**2 * area), 0.0
        factor = 0.02
        for _ in range(50):
            factor = (-2 * math.log10(2.51 / (reynolds * math.sqrt(factor)))) ** -2
    return 0.0, factor / (2 * GRAVITY * diameter * area**2)


def simulate(np, run: Run, p: dict, reaches: int, end_s: float):
    """Heads at the pressure sensors, m, a row a sensor, and the time step, s.

    Along each characteristic friction and rate of creep are averaged over both ends, friction linear in the new flow; each node's strain follows
    `tau de/dt = J c h - e` by the trapezoidal rule, solved together with the head.
    """
    length, diameter, wall = run.pipe["length_m"], run.pipe["inner_diameter_mm"] / 1e3, run.pipe["wall_thickness_mm"] / 1e3
    area = math.pi / 4 * diameter**2
    a, flow0 = p["a"], p["velocity"] * area
    dx = length / reaches
    dt = dx / a
    b = a / (GRAVITY * area)
    linear, square = (p["friction"] * law for law in friction(run, p["velocity"]))
    x = np.linspace(0.0, length, reaches + 1)
    head = p["head"] + (linear * flow0 + square * flow0 * flow0) * (length - x)
    supply, discharge = head[0], run.valve.get("discharge_head_m", 0.0)
    per_root = flow0 / math.sqrt(p["head"] - discharge)
    flow = np.full(reaches + 1, flow0)
    still = head.copy()
    tau = np.array(p["tau"])[:, None]
    pull = np.array(p["J"])[:, None] * 1e-9 * run.constraint * run.density * GRAVITY * diameter / (2 * wall)
    keep, gain = (tau - 0.5 * dt) / (tau + 0.5 * dt), pull * 0.5 * dt / (tau + 0.5 * dt)
    half = 0.5 * dt * 2 * a * a / GRAVITY
    stiff = 1.0 + half * float(((pull - gain) / tau).sum())
    strain = np.zeros((len(p["J"]), reaches + 1))
    above, rate = np.zeros(reaches + 1), np.zeros(reaches + 1)
    steps = int(math.ceil(end_s / dt)) + 2
    nodes = [min(int(pos / dx), reaches - 1) for pos, *_ in run.pressures]
    shares = np.array([pos / dx - node for (pos, *_), node in zip(run.pressures, nodes)])
    nodes = np.array(nodes)
    seen = np.empty((steps + 1, len(nodes)))
    seen[0] = head[nodes] * (1 - shares) + head[nodes + 1] * shares
    for i in range(1, steps + 1):
        resist = 0.5 * dx * (linear + square * np.abs(flow))
        drag = flow * (b - resist)
        fixed = (keep * strain + gain * above)
        # What of the new rate of creep does not hang on the new head.
        late = half * -(fixed / tau).sum(axis=0) - (stiff - 1.0) * still
        early = half * rate
        impedance = b + resist
        plus = head[:-1] + drag[:-1] - early[:-1] - late[1:]
        minus = head[1:] - drag[1:] - early[1:] - late[:-1]
        new_head, new_flow = np.empty(reaches + 1), np.empty(reaches + 1)
        new_head[1:-1] = (plus[:-1] + minus[1:]) / (2 * stiff)
        new_flow[1:-1] = (plus[:-1] - minus[1:]) / (2 * impedance[1:-1])
        new_head[0] = supply
        new_flow[0] = (stiff * supply - minus[0]) / impedance[0]
        root = per_root * max(0.0, 1.0 - i * dt / p["closing"])
        z, over = impedance[-1] / stiff, plus[-1] / stiff - discharge
        end = 0.5 * (-z * root**2 + root * math.sqrt(z * z * root**2 + 4 * over)) if over > 0 else 0.0
        new_flow[-1] = end
        new_head[-1] = plus[-1] / stiff - z * end
        head, flow = new_head, new_flow
        above = head - still
        strain = fixed + gain * above
        rate = ((pull * above - strain) / tau).sum(axis=0)
        seen[i] = head[nodes] * (1 - shares) + head[nodes + 1] * shares
    return seen.T, dt


LOGS = ["a", "J1", "tau1", "J2", "tau2", "velocity", "closing", "friction"]
NAMES = {
    "a": "wave_speed_m_s", "J1": "J1_per_GPa", "tau1": "tau1_s", "J2": "J2_per_GPa", "tau2": "tau2_s",
    "velocity": "initial_velocity_m_s", "closing": "closing_time_s", "friction": "friction_scale",
    "head": "valve_head_m", "start": "closure_start_s",
}


def fit(case: dict) -> dict:
    """The peer's fit; its seconds are those of this process from reading the CSV on, imports apart."""
    import numpy as np
    import scipy
    from scipy.interpolate import CubicSpline
    from scipy.optimize import least_squares

    began = time.perf_counter()
    run = Run(Path(case["csv"]).read_text(), tomllib.loads(case["rig"]), np)
    start = case["start"]
    names = [*NAMES, *(f"offset{s}" for s in range(len(run.pressures)))]
    x0 = np.array([math.log(start[n]) if n in LOGS else start.get(n, 0.0) for n in names])
    nominal = math.log(run.valve["closing_time_s"])
    before = [np.mean(values[t < start["start"]]) for t, values in run.flows]
    area = math.pi / 4 * (run.pipe["inner_diameter_mm"] / 1e3) ** 2
    known_velocity = math.log(before[0] / area) if before else None
    lower, upper = np.full(len(x0), -np.inf), np.full(len(x0), np.inf)
    for j, name in enumerate(names):
        reach = {"a": 0.5, "J": 8.0, "t": 6.0, "v": 1.0, "c": 3.0, "f": 1.6}.get(name[0]) if name in LOGS else None
        reach = {"start": 0.1, "head": 50.0}.get(name, 20 * run.pressures[0][3]) if reach is None else reach
        lower[j], upper[j] = x0[j] - reach, x0[j] + reach
    period = 4 * run.pipe["length_m"] / start["a"]
    solves = 0

    def values(x) -> dict:
        p = {n: math.exp(v) if n in LOGS else v for n, v in zip(names, x)}
        return p | {"J": [p["J1"], p["J2"]], "tau": [p["tau1"], p["tau2"]]}

    def residuals(x, horizon: float):
        nonlocal solves
        solves += 1
        p = values(x)
        spans = [(t >= start["start"] - 0.1 * period) & (t <= start["start"] + horizon) for _, t, *_ in run.pressures]
        latest = max(t[span][-1] for (_, t, *_), span in zip(run.pressures, spans)) - p["start"]
        seen, dt = simulate(np, run, p, case["reaches"], latest)
        times = dt * np.arange(seen.shape[1])
        out = []
        for s, ((_, t, heads, _), span) in enumerate(zip(run.pressures, spans)):
            after = t[span] - p["start"]
            model = np.where(after <= 0, seen[s][0], CubicSpline(times, seen[s])(np.maximum(after, 0.0)))
            out.append((heads[span] - p[f"offset{s}"] - model) / case["noise_m"][s])
        known = [x[names.index(f"offset{s}")] / sensor[3] for s, sensor in enumerate(run.pressures)]
        known += [(math.log(p["closing"]) - nominal) / 0.5, math.log(p["friction"]) / 0.2]
        if known_velocity is not None:
            known.append((math.log(p["velocity"]) - known_velocity) / 0.01)
        return np.concatenate([*out, known])

    x = x0
    for horizon, tolerance in [(1.5 * period, 3e-4), (5 * period, 3e-4), (math.inf, 1e-5)]:
        found = least_squares(
            residuals, x, bounds=(lower, upper), x_scale="jac", ftol=tolerance, xtol=1e-8, diff_step=1e-5, args=(horizon,)
        )
        x = found.x
    p = values(x)
    after = [t >= p["start"] for _, t, *_ in run.pressures]
    seen, dt = simulate(np, run, p, case["reaches"], max(t[-1] for _, t, *_ in run.pressures) - p["start"])
    times = dt * np.arange(seen.shape[1])
    squares = [
        (heads[span] - p[f"offset{s}"] - CubicSpline(times, seen[s])(t[span] - p["start"])) ** 2
        for s, ((_, t, heads, _), span) in enumerate(zip(run.pressures, after))
    ]
    return {
        "versions": f"numpy {np.__version__}, scipy {scipy.__version__}",
        "seconds": time.perf_counter() - began,
        "solves": solves,
        "rmse_m": float(np.sqrt(np.mean(np.concatenate(squares)))),
        "values": {n: p[n] for n in NAMES},
    }


def rig_of(mcap: Path) -> str:
    """The rig file that stands in a recording as an attachment (https://mcap.dev/spec, opcode 0x09)."""
    data = mcap.read_bytes()
    at = 8
    number = lambda i, n: int.from_bytes(data[i : i + n], "little")  # noqa: E731
    while at < len(data) - 8:
        opcode, length = data[at], number(at + 1, 8)
        if opcode == 0x09:
            i = at + 9 + 16
            i += 4 + number(i, 4)
            i += 4 + number(i, 4)
            return data[i + 8 : i + 8 + number(i, 8)].decode()
        at += 9 + length
    sys.exit(f"{mcap} holds no rig file")


def timed(command: list[str]) -> tuple[float, float, str]:
    """Wall seconds of a process from its start to its end, its CPU seconds, and what it prints."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    wall = time.perf_counter() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return wall, cpu, done.stdout


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/surgescope")
    parser.add_argument("--python", default=sys.executable, help="a Python that has numpy and scipy")
    parser.add_argument("--recording", type=Path, default=Path("recordings/hdpe-nothing-missing.mcap"))
    parser.add_argument("--turns", type=int, default=9)
    parser.add_argument("--case", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.case:
        json.dump(fit(json.loads(Path(args.case).read_text())), sys.stdout)
        return 0
    calibrate = [args.program, "calibrate", str(args.recording), "--effects", "viscoelastic-wall:2", "--json"]
    turns = [timed(calibrate) for _ in range(args.turns)]
    ours = json.loads(turns[0][2])
    # One trial of a global search is its start: where the program's own fit starts, too.
    start = json.loads(timed([*calibrate, "--method", "global", "--budget", "1"])[2])
    at = {p["name"]: p["value"] for p in start["parameters"]}
    with tempfile.TemporaryDirectory() as folder:
        csv = Path(folder) / "run.csv"
        subprocess.run([args.program, "export", str(args.recording), "-o", str(csv)], check=True, capture_output=True)
        case = {
            "csv": str(csv),
            "rig": rig_of(args.recording),
            "start": {short: at[name] for short, name in NAMES.items()},
            "noise_m": [s["noise_m"] for s in ours["runs"][0]["sensors"]],
            "reaches": REACHES,
        }
        path = Path(folder) / "case.json"
        path.write_text(json.dumps(case))
        peer_wall, peer_cpu, text = timed([args.python, str(HERE / "scipy_fit.py"), "--case", str(path)])
        turns += [timed(calibrate) for _ in range(args.turns)]
    peer = json.loads(text)
    best, median = min(t[0] for t in turns), statistics.median(t[0] for t in turns)
    cpu = statistics.median(t[1] for t in turns)
    rmse = ours["runs"][0]["rmse_m"]
    print(f"{args.recording}: two Kelvin-Voigt elements, {REACHES} reaches, whole process")
    print(f"  surgescope  {best:8.2f} s best, {median:.2f} s median of {len(turns)}, {cpu:.2f} s of CPU; {ours['evaluations']} solves on all grids; RMSE {rmse:.5f} m")
    print(f"  scipy       {peer_wall:8.2f} s, {peer_cpu:.2f} s of CPU, {peer['seconds']:.2f} s without imports; {peer['solves']} solves; RMSE {peer['rmse_m']:.5f} m  ({peer['versions']})")
    fitted = {p["name"]: p["value"] for p in ours["parameters"]}
    for short, name in NAMES.items():
        print(f"  {name:24} {fitted[name]:12.5g} {peer['values'][short]:12.5g}")
    ratio = peer["seconds"] / median
    print(f"ratio, scipy without imports over the program's median: {ratio:.0f} (bar {BAR:.0f})")
    print(f"the same of CPU seconds, which other work on the machine hardly changes: {peer_cpu / cpu:.0f}")
    same = abs(peer["rmse_m"] / rmse - 1) < SAME
    if not same:
        print(f"the errors differ by more than {100 * SAME:.0f}%")
    return 0 if same and ratio >= BAR else 1


if __name__ == "__main__":
    sys.exit(main())
