"""Exact waves in water and wall of straight pipes in series, for a valve that closes: an outside check of `fluid-structure`.

wall_recursion.py problem-a > tests/reference/wall_problem_a.csv
wall_recursion.py two-pipes > tests/reference/wall_two_pipes.csv
wall_recursion.py --pipe 20,0.797,0.008,210e9,7900,0.3 [--pipe ...] [--valve anchored] [--closing-time 0.01] [--until 0.2] [--step 1e-3]

Pipes are given from the supply to the valve: length, inner diameter and wall in m, Young's modulus in Pa, density of the wall in kg/m³,
Poisson's ratio. The water has K = 2.1 GPa and 1000 kg/m³, and flows at 1 m/s in the pipe at the valve.

The four equations without friction (Skalak 1956; Tijsseling 2003, J. Fluids Struct. 18:179-196), in velocity and pressure of the water
and velocity and axial stress of the wall:

    V_t + P_x/ρ = 0             V_x + (1/K + (1 - ν²) D/(E e)) P_t = 2ν u_x
    u_t - σ_x/ρ_w = 0           u_x - σ_t/E = -ν D/(2 E e) P_t

Each pipe has four waves of constant speed, whose jumps do not change on their way. At the supply P = 0 and u = 0; at the valve V - u is
given, and u = 0 or A_w σ = A P; at a joint P, u, A (V - u) and A_w σ - A P are continuous. So a jump that arrives sends on jumps that
are a fixed matrix times it. The recursion runs forwards: jumps that took the same number of passages through each pipe in each wave
arrive together and are one. There is no grid and no error but rounding. Values are deviations from the steady flow."""
import argparse
import heapq
import math
from collections import defaultdict

BULK, DENSITY, GRAVITY, VELOCITY = 2.1e9, 1000.0, 9.81, 1.0
DELFT_A = (20.0, 0.797, 0.008, 210e9, 7900.0, 0.30)
STEEL_THEN_PVC = ((30.0, 0.3, 0.006, 206e9, 7850.0, 0.30), (20.0, 0.2, 0.0077, 3.1e9, 1400.0, 0.42))
# Pipes, what holds the valve, closing time, until, step.
RIGS = {
    "problem-a": ((DELFT_A,), "free", 0.0, 0.16, 5e-4),
    "two-pipes": (STEEL_THEN_PVC, "free", 0.05, 0.6, 2.5e-3),
}


class Pipe:
    def __init__(self, length, diameter, wall, modulus, wall_density, poisson):
        self.area = math.pi / 4 * diameter**2
        self.wall_area = math.pi * diameter * wall
        ratio = diameter / wall
        c2 = 1 / (DENSITY * (1 / BULK + (1 - poisson**2) * ratio / modulus))
        ct2 = modulus / wall_density
        coupling = poisson**2 * DENSITY / wall_density * ratio * c2
        # λ⁴ - (c² + ct² + coupling) λ² + c² ct² = 0
        both = c2 + ct2 + coupling
        fast2 = (both + math.sqrt(both**2 - 4 * c2 * ct2)) / 2
        slow2 = c2 * ct2 / fast2
        self.speeds = [math.sqrt(slow2), math.sqrt(fast2)]
        self.travel = [length / speed for speed in self.speeds]

        def wave(speed, fast):
            square = speed**2
            if fast:
                stress = 1.0
                pressure = 2 * poisson / (wall_density * square) / (1 / (DENSITY * c2) - 1 / (DENSITY * square))
            else:
                pressure = 1.0
                stress = poisson * ratio / 2 * square / (square - ct2)
            return [pressure / (DENSITY * speed), pressure, -stress / (wall_density * speed), stress]

        self.down = [wave(speed, fast) for fast, speed in enumerate(self.speeds)]
        self.up = [wave(-speed, fast) for fast, speed in enumerate(self.speeds)]

    def joined(self, wave):
        """What is continuous at a joint, in similar units."""
        v, p, u, s = wave
        return [p / 1e6, u, self.area * (v - u), (self.wall_area * s - self.area * p) / 1e6]


def solve(rows, right):
    """x of rows x = right, by elimination with pivots."""
    n = len(rows)
    rows = [list(row) + [r] for row, r in zip(rows, right)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(k + 1, n):
            by = rows[i][k] / rows[k][k]
            rows[i] = [a - by * b for a, b in zip(rows[i], rows[k])]
    x = [0.0] * n
    for k in reversed(range(n)):
        x[k] = (rows[k][n] - sum(rows[k][j] * x[j] for j in range(k + 1, n))) / rows[k][k]
    return x


class Node:
    """The supply, a joint or the valve: (pipe, direction, wave) of what arrives and leaves, and the laws on each."""

    def __init__(self, pipes, number, valve):
        self.arriving, self.leaving = [], []
        first, last = number == 0, number == len(pipes)
        laws = {}
        for pipe, here in ((number - 1, "end"), (number, "start")):
            if not 0 <= pipe < len(pipes):
                continue
            own, sign = pipes[pipe], 1 if here == "end" else -1
            for direction, waves in ((1, own.down), (-1, own.up)):
                for k, wave in enumerate(waves):
                    v, p, u, s = wave
                    if first:
                        law = [p / 1e6, u]
                    elif last:
                        law = [v - u, u if valve == "anchored" else (own.wall_area * s - own.area * p) / 1e6]
                    else:
                        law = [sign * x for x in own.joined(wave)]
                    laws[pipe, direction, k] = law
                    (self.arriving if direction == sign else self.leaving).append((pipe, direction, k))
        self.laws = laws

    def send(self, arriving, given):
        """Amplitudes that leave for those that arrive and for the right sides of the laws."""
        count = len(self.leaving)
        right = [given[i] - sum(a * self.laws[w][i] for w, a in arriving.items()) for i in range(count)]
        return dict(zip(self.leaving, solve([[self.laws[w][i] for w in self.leaving] for i in range(count)], right)))


def jumps_at_valve(pipes, valve, until):
    """(time, jumps of V, P, u and σ) at the valve, for one that closes at once at time 0."""
    count = len(pipes)
    nodes = [Node(pipes, n, valve) for n in range(count + 1)]
    ways = [pipe.travel[k] for pipe in pipes for k in (0, 1)]
    arrivals = defaultdict(dict)
    start = (count, (0,) * len(ways))
    arrivals[start] = {}
    queue, found = [(0.0, start)], []
    while queue:
        time, (number, passages) = heapq.heappop(queue)
        arriving = arrivals.pop((number, passages))
        given = [-VELOCITY if not any(passages) else 0.0] + [0.0] * 3
        leaving = nodes[number].send(arriving, given)
        if number == count:
            waves = [(a, (pipes[p].down if d > 0 else pipes[p].up)[k]) for (p, d, k), a in {**arriving, **leaving}.items()]
            found.append((time, [sum(a * wave[i] for a, wave in waves) for i in range(4)]))
        for (pipe, direction, k), amplitude in leaving.items():
            way = 2 * pipe + k
            then = tuple(n + (i == way) for i, n in enumerate(passages))
            to = (number + direction, then)
            at = sum(n * way_s for n, way_s in zip(then, ways))
            if at > until:
                continue
            if to not in arrivals:
                heapq.heappush(queue, (at, to))
            arrivals[to][pipe, direction, k] = arrivals[to].get((pipe, direction, k), 0.0) + amplitude
    return found


def closed(time, closing_time):
    """Share of the flow that is stopped: at once, or by a cycloid, whose rate has no corner."""
    if time < 0 or closing_time == 0:
        return float(time >= 0)
    s = min(time / closing_time, 1.0)
    return s - math.sin(2 * math.pi * s) / (2 * math.pi)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rig", nargs="?", choices=RIGS)
    parser.add_argument("--pipe", action="append", help="length,diameter,wall,modulus,wall density,Poisson's ratio")
    parser.add_argument("--valve", choices=["free", "anchored"])
    parser.add_argument("--closing-time", type=float)
    parser.add_argument("--until", type=float)
    parser.add_argument("--step", type=float)
    args = parser.parse_args()
    given, *usual = RIGS[args.rig or "problem-a"]
    if args.pipe:
        given = [tuple(float(x) for x in pipe.split(",")) for pipe in args.pipe]
    own = [args.valve, args.closing_time, args.until, args.step]
    valve, closing_time, until, step = (a if a is not None else b for a, b in zip(own, usual))
    pipes = [Pipe(*pipe) for pipe in given]
    found = jumps_at_valve(pipes, valve, until)
    for pipe, (slow, fast) in zip(given, (pipe.speeds for pipe in pipes)):
        print(f"# pipe of {', '.join(f'{x:g}' for x in pipe)}: waves at {slow:.4f} and {fast:.4f} m/s")
    print(f"# supply anchored, valve {valve}, closed in {closing_time:g} s; python3 tools/wall_recursion.py")
    print("# t_s,dH_valve_m,du_valve_m_s,dsigma_valve_MPa")
    # Between fronts, where all stand at whole multiples of a step.
    for n in range(int(until / step)):
        time = (n + 0.5) * step
        _, p, u, s = (sum(jump[i] * closed(time - at, closing_time) for at, jump in found) for i in range(4))
        print(f"{time:.6f},{p / (DENSITY * GRAVITY):.6f},{u:.8f},{s / 1e6:.6f}")


if __name__ == "__main__":
    main()
