#!/usr/bin/env python3
"""Writes tests/fixtures/nptdms.tdms, nptdms-stretches.tdms and nptdms-rates.tdms with npTDMS (pip install nptdms numpy), and what npTDMS reads back from it.

The file has what acquisition programs write: several segments (the later ones without new metadata), raw counts with a linear
and a polynomial scale, waveform properties, a unit, a channel of timestamps beside a slow one, text, and two groups with
different rates. `python3 tools/tdms_fixture.py FOLDER` also puts hand-made files for the fuzzer there: interleaved, big-endian,
cut off.
"""
import json
import struct
import sys
from pathlib import Path

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter

FIXTURES = Path(__file__).parent.parent / "tests/fixtures"
START = np.datetime64("2026-03-14T09:26:53.250000")


def fixture(path):
    fast = {"wf_increment": 1e-4, "wf_start_time": START, "wf_start_offset": 0.0, "wf_samples": 1}
    linear = {
        "NI_Number_Of_Scales": 1,
        "NI_Scaling_Status": "unscaled",
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.02,
        "NI_Scale[0]_Linear_Y_Intercept": 450.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
        "unit_string": "kPa",
    }
    cubic = {
        "NI_Number_Of_Scales": 2,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 1.0 / 3276.8,
        "NI_Scale[0]_Linear_Y_Intercept": 0.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
        "NI_Scale[1]_Scale_Type": "Polynomial",
        "NI_Scale[1]_Polynomial_Coefficients_Size": 4,
        "NI_Scale[1]_Polynomial_Input_Source": 0,
        **{f"NI_Scale[1]_Polynomial_Coefficients[{k}]": c for k, c in enumerate([0.5, 2.0, -0.25, 0.01])},
        "unit_string": "bar",
    }
    root = RootObject({"Operator": "A. Joukowsky", "test": 7})
    group = GroupObject("Fast 'piezo'", {"description": "valve end"})
    # segments: counts that rise, then the same channels again
    with TdmsWriter(path) as writer:
        for segment in range(3):
            counts = (np.arange(40) + 40 * segment).astype(np.int16) * 50 - 3000
            volts = (np.sin(np.arange(40) + segment) * 3000).astype(np.int32)
            trigger = (np.arange(40) + 40 * segment >= 60).astype(np.uint8)
            temperature = np.array([20.0 + segment, 20.5 + segment], dtype=np.float32)
            stamps = START + np.array([segment * 10, segment * 10 + 5]).astype("timedelta64[ms]")
            first = segment == 0
            writer.write_segment(
                ([root, group] if first else [])
                + [
                    ChannelObject("Fast 'piezo'", "P1", counts, {**fast, **linear} if first else {}),
                    ChannelObject("Fast 'piezo'", "P2", volts, {**fast, **cubic} if first else {}),
                    ChannelObject("Fast 'piezo'", "Valve", trigger, fast if first else {}),
                    ChannelObject("Slow", "T1", temperature, {"unit_string": "degC"} if first else {}),
                    ChannelObject("Slow", "Stamp", stamps),
                    ChannelObject("Slow", "Remark", ["a", "b"]),
                ]
            )
    read = TdmsFile.read(path)
    expected = {}
    for group, channel in [("Fast 'piezo'", "P1"), ("Fast 'piezo'", "P2"), ("Fast 'piezo'", "Valve"), ("Slow", "T1")]:
        data = read[group][channel]
        expected[channel] = {"value": [float(v) for v in data[:]]}
        if group != "Slow":
            expected[channel]["time_s"] = [float(t) for t in data.time_track()]
    stamps = read["Slow"]["Stamp"][:]
    expected["T1"]["time_s"] = [float((t - START) / np.timedelta64(1, "ns")) * 1e-9 for t in stamps]
    path.with_suffix(".json").write_text(json.dumps(expected) + "\n")


def stretches(path):
    """Group A: values that are no numbers. Group B: a second stretch that begins later, in a segment of its own."""
    wave = {"wf_increment": 0.01, "wf_start_time": START, "wf_start_offset": 0.0, "wf_samples": 1}
    a = np.arange(50.0)
    a[[0, 7, 8]] = np.nan, np.inf, np.nan
    later = {**wave, "wf_start_time": START + np.timedelta64(10, "s"), "wf_increment": 0.02}
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("A", "P1", a, wave), ChannelObject("B", "P1", np.arange(50.0), wave)])
        writer.write_segment([ChannelObject("B", "P1", np.arange(50.0, 60.0), later)])
        # group C: what only the second segment states, group D: and corrected behind the last value, is of all values
        writer.write_segment([ChannelObject(group, "P1", np.arange(5.0), {}) for group in "CD"])
        writer.write_segment([ChannelObject(group, "P1", np.arange(5.0, 9.0), wave) for group in "CD"])
        writer.write_segment([ChannelObject("D", "P1", np.array([]), later)])


def rates(path):
    """Group A: no times. Group B: a rate under a name of the user's own. Group C: each channel behind times of its own. Group D: text."""
    i = np.arange(100.0)
    with TdmsWriter(path) as writer:
        writer.write_segment([
            ChannelObject("A", "P1", i),
            GroupObject("B", {"Sample Rate": 500.0}),
            ChannelObject("B", "P1", i),
            ChannelObject("C", "Time 1", 0.001 * i),
            ChannelObject("C", "P1", i),
            ChannelObject("C", "Time 2 (ms)", 4.0 * i),
            ChannelObject("C", "P2", 2 * i),
            ChannelObject("D", "Remark", ["a", "b"]),
        ])


def handmade(folder, big, interleaved, cut):
    """Two segments of two channels, i16 and f64; the second one says 'as before'."""
    e = ">" if big else "<"
    text = lambda s: struct.pack(e + "I", len(s)) + s.encode()
    channel = lambda name, kind, index: text(name) + index + (
        struct.pack(e + "I", 1) + text("wf_increment") + struct.pack(e + "Id", 10, 0.001) if kind else struct.pack(e + "I", 0)
    )
    new = lambda kind: struct.pack(e + "IIIQ", 20, kind, 1, 3)
    names = ["/'g'/'P1'", "/'g'/'P2'"]
    first = struct.pack(e + "I", 2) + channel(names[0], True, new(2)) + channel(names[1], True, new(10))
    again = struct.pack(e + "I", 2) + b"".join(channel(n, False, struct.pack(e + "I", 0)) for n in names)
    out = b""
    for number, metadata in enumerate([first, again]):
        a, b = [number * 3 + i for i in range(3)], [0.5 * (number * 3 + i) for i in range(3)]
        if interleaved:
            raw = b"".join(struct.pack(e + "hd", x, y) for x, y in zip(a, b))
        else:
            raw = struct.pack(e + "3h3d", *a, *b)
        flags = 2 | 8 | (4 if number == 0 else 0) | (32 if interleaved else 0) | (64 if big else 0)
        length = len(metadata) + len(raw)
        if cut and number == 1:
            raw, length = raw[:-5], 0xFFFFFFFFFFFFFFFF
        out += b"TDSm" + struct.pack("<I", flags) + struct.pack(e + "IQQ", 4713, length, len(metadata)) + metadata + raw
    name = f"{'big' if big else 'little'}-{'interleaved' if interleaved else 'contiguous'}{'-cut' if cut else ''}.tdms"
    (Path(folder) / name).write_bytes(out)


if __name__ == "__main__":
    fixture(FIXTURES / "nptdms.tdms")
    stretches(FIXTURES / "nptdms-stretches.tdms")
    rates(FIXTURES / "nptdms-rates.tdms")
    for folder in sys.argv[1:]:
        handmade(folder, big=False, interleaved=False, cut=False)
        handmade(folder, big=True, interleaved=True, cut=False)
        handmade(folder, big=False, interleaved=True, cut=True)
        handmade(folder, big=True, interleaved=False, cut=True)
