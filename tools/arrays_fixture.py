"""Writes tests/fixtures/scipy.mat, h5py.h5 and h5py-v73.mat: 200 samples of two pressures in bar; and scipy-clocks.mat, scipy-scope.mat, h5py-groups.h5 and
h5py-table.h5, where the second pressure has 100 samples, twice as far apart; and h5py-runs.h5, two runs. Needs scipy and h5py."""

from pathlib import Path

import h5py
import numpy as np
import scipy.io

FIXTURES = Path(__file__).parent.parent / "tests/fixtures"
COUNT = np.arange(200)
TIME = COUNT * 1e-3
PRESSURES = [2.0 + np.sin(0.05 * COUNT), 1.5 + np.cos(0.05 * COUNT)]

# A structure with a column, a row and whole numbers; beside it what is no series of the test.
run = {"t": TIME[:, None], "P1": PRESSURES[0][None, :], "P2": np.round(PRESSURES[1] * 1e6).astype(np.int32), "valve": "ball"}
scipy.io.savemat(FIXTURES / "scipy.mat", {"run": run, "fs": 1000.0, "zero": np.zeros((3, 4))}, do_compression=True)

with h5py.File(FIXTURES / "h5py.h5", "w") as file:
    group = file.create_group("run 7").create_group("fast")
    group.create_dataset("time", data=TIME, chunks=(50,), compression="gzip", shuffle=True).attrs["units"] = "s"
    group.create_dataset("P1", data=PRESSURES[0].astype(">f8")).attrs["units"] = "bar"
    group.create_dataset("P2", data=100.0 * PRESSURES[1], maxshape=(None,), chunks=(64,), fletcher32=True).attrs["units"] = np.bytes_("kPa")
    file.create_dataset("note", data="ball valve")
    file.create_dataset("calibration", data=np.eye(3))

# As MATLAB's -v7.3: 512 bytes of its own before the file, matrices the other way round.
with h5py.File(FIXTURES / "h5py-v73.mat", "w", userblock_size=512) as file:
    file.create_group("#refs#").create_dataset("a", data=np.zeros((1, 200)))
    file.create_dataset("data", data=np.array([TIME, *PRESSURES]), compression="gzip")
with open(FIXTURES / "h5py-v73.mat", "r+b") as file:
    text = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created by: tools/arrays_fixture.py HDF5 schema 1.00 ."
    file.write(text.ljust(116) + bytes(8) + b"\x00\x02IM")

# Two clocks, in the order of the alphabet, units in a structure; beside them an array of another length, cells, lines of text, complex numbers.
SLOW = COUNT[:100]
SLOW_TIME, SLOW_P2 = SLOW * 2e-3, 1.5 + np.cos(0.1 * SLOW)
scipy.io.savemat(
    FIXTURES / "scipy-clocks.mat",
    {
        "P1": PRESSURES[0][:, None], "P2": SLOW_P2[:, None], "t1": TIME[:, None], "t2": SLOW_TIME[:, None],
        "units": {"P1": "bar", "P2": "bar", "t1": "s", "t2": "s"},
        "tank": np.arange(50.0)[:, None], "names": np.array(["upper", "lower "]), "cells": np.array([np.arange(7.0), "x"], dtype=object),
        "spectrum": np.fft.fft(np.arange(8.0)), "operator": "Kim", "run": 7,
    },
)

# As PicoScope saves: channels and the step between their samples.
scipy.io.savemat(
    FIXTURES / "scipy-scope.mat",
    {"A": PRESSURES[0][:, None], "B": PRESSURES[1][:, None], "Tinterval": 1e-3, "Tstart": -0.05, "Length": 200.0, "Version": np.array([6, 14])},
)

with h5py.File(FIXTURES / "h5py-groups.h5", "w") as file:
    for name, time, pressure in [("fast", TIME, PRESSURES[0]), ("slow", SLOW_TIME, SLOW_P2)]:
        group = file.create_group(name)
        group.create_dataset("time", data=time).attrs["unit"] = "s"
        group.create_dataset("P1" if name == "fast" else "P2", data=pressure).attrs["unit"] = "bar"
    file.create_dataset("camera", data=np.zeros((2, 3, 4), dtype="u1"))
    file.create_dataset("remarks", data=["one", "two"], dtype=h5py.string_dtype())

# Two runs with sensors of one name.
with h5py.File(FIXTURES / "h5py-runs.h5", "w") as file:
    for run, factor in [("run 1", 1.0), ("run 2", 2.0)]:
        group = file.create_group(run)
        group.create_dataset("time", data=TIME).attrs["unit"] = "s"
        for name, pressure in zip(["P1", "P2"], PRESSURES):
            group.create_dataset(name, data=factor * pressure).attrs["unit"] = "bar"

# Tables that are one dataset each, and a dataset that states its rate.
with h5py.File(FIXTURES / "h5py-table.h5", "w") as file:
    table = np.zeros(200, dtype=[("time", "<f8"), ("P1", "<f4"), ("state", "S4")])
    table["time"], table["P1"] = TIME, PRESSURES[0]
    file.create_dataset("table", data=table)
    other = file.create_dataset("P2", data=SLOW_P2)
    other.attrs["unit"], other.attrs["sampling_rate"] = "bar", 500.0
