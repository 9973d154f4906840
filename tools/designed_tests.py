"""Count the tests that tell two rivals apart: those that `next` proposes, against a second flow again and again.

designed_tests.py PROGRAM COUNT SEED: a table of docs/src/measured/reliability.md

A rig and an effect are drawn at random, and a record of it is simulated in which the effect is so weak that its rival explains it about as well. Then tests
are made until the odds of one over the other reach WANTED: each is simulated with the same effect and fresh noise, and both rivals are fitted
to all records. A draw with a record that cannot be used (a valve that lets the whole of half the flow through) does not count.
`next` proposes a test after each; of its proposals the first is made that needs nothing but another flow, closing time or
head. The habit that it is compared with is to repeat the test at half the flow. The solver is the program's own on both sides: what is counted
is the choice of the tests."""
import json
import math
import random
import subprocess
import sys
import tempfile
from pathlib import Path

WANTED, MOST, TEMPERATURE, LEAST_EVIDENCE = math.log(20.0), 8, 4.0, 12.0
STRENGTHS = ("leak_cda_mm2", "blockage_K", "branch_length_m", "section_wave_speed_ratio", "air_volume_mL", "gas_fraction", "seat_cda_mm2",
             "supply_head_change_m")
NOISE = 0.003  # of the surge
RIVALS = [("leak", "blockage"), ("leak", "valve-seat-leak"), ("leak", "supply-drift"), ("blockage", "unsteady-friction"),
          ("air-pocket", "entrained-gas"), ("side-branch", "section-change"), ("air-pocket", "moving-valve"),
          ("valve-seat-leak", "supply-drift")]


def drawn(rng):
    """A rig, the run's settings, its sampling and the values of every effect on it."""
    length = rng.uniform(40.0, 150.0)
    material, speed = rng.choice([("copper", 1280.0), ("steel", 1150.0)])
    diameter_mm = rng.choice([16.0, 22.1, 32.0, 50.6])
    period = 4.0 * length / speed
    surge = rng.uniform(10.0, 40.0)
    sensors = [length] + ([length * rng.uniform(0.4, 0.7)] if rng.random() < 0.5 else [])
    rig = f"""name = "drawn"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = {length:.2f}
inner_diameter_mm = {diameter_mm}
wall_thickness_mm = {0.06 * diameter_mm:.3f}
material = "{material}"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = {0.1 * period:.4f}
"""
    for i, place in enumerate(sensors):
        rig += f'[[sensor]]\nname = "P{i + 1}"\nkind = "pressure"\nposition_m = {place:.2f}\nunit = "kPa"\n'
    rig += '[[sensor]]\nname = "Q1"\nkind = "flow"\nposition_m = 0.0\nunit = "m3/h"\n'
    run = {"initial_velocity_m_s": surge * 9.81 / speed, "valve_head_m": surge + rng.uniform(15.0, 40.0), "closing_time_s": 0.1 * period}
    area_mm2, place = math.pi / 4.0 * diameter_mm**2, length * rng.uniform(0.2, 0.8)
    effects = {
        "leak": {"leak_position_m": place, "leak_cda_mm2": area_mm2 * 10 ** rng.uniform(-3.5, -2.5)},
        "blockage": {"blockage_position_m": place, "blockage_K": 10 ** rng.uniform(1.5, 2.7)},
        "side-branch": {"branch_position_m": place, "branch_length_m": length * rng.uniform(0.02, 0.1), "branch_area_ratio": rng.uniform(0.1, 1.0)},
        "section-change": {"section_start_m": place, "section_end_m": min(place + length * rng.uniform(0.1, 0.3), 0.98 * length),
                           "section_wave_speed_ratio": rng.uniform(0.85, 0.97)},
        "air-pocket": {"air_volume_mL": area_mm2 * length * 10 ** rng.uniform(-6.5, -5.0)},
        "entrained-gas": {"gas_fraction": 10 ** rng.uniform(-6.0, -4.5)},
        "valve-seat-leak": {"seat_cda_mm2": area_mm2 * 10 ** rng.uniform(-3.5, -2.5)},
        "supply-drift": {"supply_head_change_m": surge * rng.uniform(0.03, 0.2), "supply_time_constant_s": period * rng.uniform(1.0, 6.0)},
    }
    return rig, run, {"duration": 12.0 * period, "rate": 400.0 / period, "surge_m": surge}, effects


class Lab:
    """One rig with its hidden effect: it makes tests, and fits both rivals to all of them."""

    def __init__(self, program, folder, rig, sampling, effect, values):
        self.program, self.folder, self.sampling, self.effect, self.values = program, Path(folder), sampling, effect, values
        (self.folder / "rig.toml").write_text(rig)
        self.made = 0

    def call(self, *args):
        run = subprocess.run([self.program, *args], capture_output=True, text=True, cwd=self.folder)
        if run.returncode not in (0, 1):
            raise RuntimeError(run.stderr.strip())
        return run.stdout

    def test(self, run, noise_m):
        self.made += 1
        name, values = f"{self.made}.mcap", {**run, **self.values}
        self.call("simulate", "--rig", "rig.toml", "--effects", self.effect, "--set", *[f"{k}={v}" for k, v in values.items()], "--noise-m", str(noise_m),
                  "--duration", str(self.sampling["duration"]), "--rate", str(self.sampling["rate"]), "--seed", str(self.made), "-o", name)
        return name

    def weaken(self, by):
        name = next(name for name in self.values if name in STRENGTHS)
        gone = 1.0 if name.endswith("ratio") else 0.0
        self.values = {**self.values, name: gone + by * (self.values[name] - gone)}

    def fit(self, records, effect):
        """The sum of squares in units of the noise, the parameters and the samples."""
        fit = json.loads(self.call("calibrate", *records, "--effects", effect, "--json"))
        sensors = [s for run in fit["runs"] for s in run["sensors"]]
        square = sum(s["samples"] * (s["rmse_m"] / s["noise_m"]) ** 2 for s in sensors)
        return square, len(fit["parameters"]), sum(s["samples"] for s in sensors)

    def evidence(self, records, one, other):
        """Logarithm of the odds of one model over another, before tempering (Schwarz)."""
        (a, ka, n), (b, kb, _) = self.fit(records, one), self.fit(records, other)
        return 0.5 * (b - a) / max(1.0, min(a, b) / n) + 0.5 * (kb - ka) * math.log(n)

    def proposed(self, records, rivals):
        """The settings of the first proposal that needs nothing new on the rig."""
        (self.folder / "model.toml").unlink(missing_ok=True)
        self.call("calibrate", *records, "--effects", "none", "--save", "model.toml", "--json")
        tests = json.loads(self.call("next", "model.toml", "--between", ",".join(rivals), "--json"))["answers"][0]["tests"]
        plain = ("repeat", "close", "raise", "lower")
        for test in tests:
            settings = test["settings"]
            if test["instruction"].startswith(plain) and "warmer" not in test["instruction"]:
                return {"initial_velocity_m_s": settings["velocity_m_s"], "valve_head_m": settings["valve_head_m"], "closing_time_s": settings["closing_time_s"]}
        return None

    def tests_needed(self, first, rivals, noise_m, choose):
        """How many tests bring the odds to WANTED for either, and whether for the true one."""
        records = [first]
        for n in range(1, MOST + 1):
            records.append(self.test(choose(records), noise_m))
            odds = self.evidence(records, *rivals) / TEMPERATURE
            if abs(odds) > WANTED:
                return n, odds > 0.0
        return MOST, None


def compared(program, rng):
    """Both ways for one drawn pair; none where the rivals cannot be made alike."""
    rig, run, sampling, effects = drawn(rng)
    true, rival = rivals = rng.choice([pair for pair in (*RIVALS, *(pair[::-1] for pair in RIVALS)) if pair[0] in effects])
    target = rng.uniform(0.02, 0.35) * WANTED
    with tempfile.TemporaryDirectory() as folder:
        lab = Lab(program, folder, rig, sampling, true, effects[true])
        noise_m = NOISE * sampling["surge_m"]
        first = lab.test(run, noise_m)
        strong = lab.evidence([first], *rivals) / TEMPERATURE
        if strong > WANTED:
            # what an effect does is in proportion to its strength, and evidence to the square of it
            lab.weaken(math.sqrt(target / strong))
            first = lab.test(run, noise_m)
        if abs(lab.evidence([first], *rivals) / TEMPERATURE) > WANTED or lab.evidence([first], true, "none") < LEAST_EVIDENCE:
            return None
        half = {**run, "initial_velocity_m_s": 0.5 * run["initial_velocity_m_s"]}
        habit = lab.tests_needed(first, rivals, noise_m, lambda _: half)
        designed = lab.tests_needed(first, rivals, noise_m, lambda records: lab.proposed(records, rivals) or half)
    return {"true": true, "rival": rival, "designed": designed, "habit": habit}


if __name__ == "__main__":
    program, count, seed = str(Path(sys.argv[1]).resolve()), int(sys.argv[2]), int(sys.argv[3])
    rng, found = random.Random(seed), []
    print("| true | rival | designed | a second flow |")
    print("| --- | --- | --- | --- |")
    while len(found) < count:
        try:
            one = compared(program, rng)
        except RuntimeError as refused:
            if "no closure in this recording" not in str(refused):
                raise
            print(f"not counted: {str(refused).splitlines()[-1].strip()}", file=sys.stderr)
            continue
        if one is None:
            continue
        found.append(one)
        said = [f"{n}" if right else f"{n}, the wrong one" if right is False else f"> {n}" for n, right in (one["designed"], one["habit"])]
        print(f"| {one['true']} | {one['rival']} | {said[0]} | {said[1]} |", flush=True)
    for name in ("designed", "habit"):
        ns = sorted(one[name][0] for one in found)
        wrong, never = (sum(one[name][1] is x for one in found) for x in (False, None))
        print(f"{name}: {sum(ns) / len(ns):.2f} tests mean, {ns[len(ns) // 2]} median; {never} not told apart by {MOST}, {wrong} told wrongly")
