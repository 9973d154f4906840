#!/usr/bin/env python3
"""Checks a recording against the time series it was made from, with readers that share nothing with surgescope.

    python3 -m venv venv && venv/bin/pip install mcap mcap-protobuf-support
    venv/bin/python tools/check_mcap.py run.mcap run.csv [rig.toml]

Decodes each message with the schema inside the file, as any MCAP tool does, and compares every sample with the CSV: same
times, same values, none missing, none too many. Of a recording with a model beside it, it checks that modelled value and residual
make up each sample. Exit code 0 when all agrees, 1 with what does not.
"""

import csv
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

MODELLED = "surgescope.Modelled"
SCHEMAS = {"surgescope.Sample", "surgescope.Block", "surgescope.Gap", MODELLED}


class Mismatch(Exception):
    """The recording and the time series do not agree."""


def expect(condition, message):
    if not condition:
        raise Mismatch(message)


def samples_of_csv(path):
    """{sensor: [(time_s, value)]}"""
    with open(path, newline="", encoding="utf-8-sig") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        columns = {name: [] for name in rows.fieldnames[1:]}
        for row in rows:
            for name, samples in columns.items():
                if row[name]:
                    samples.append((float(row["time_s"]), float(row[name])))
    return columns


def samples_of_mcap(path):
    """{sensor: [(time_s, value)]} and the rig file inside."""
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        expect(summary is not None and summary.statistics is not None, "no summary: the file is not finished")
        expect(summary.chunk_indexes, "no chunk index")
        expect(all(c.compression == "zstd" for c in summary.chunk_indexes), "a chunk is not zstd")
        for schema in summary.schemas.values():
            expect(schema.name in SCHEMAS and schema.encoding == "protobuf", f"schema {schema.name} {schema.encoding}")
        rigs = [a.data.decode() for a in reader.iter_attachments() if a.name == "rig.toml"]
        expect(len(rigs) == 1, f"{len(rigs)} attachments rig.toml")
        runs = [m.metadata for m in reader.iter_metadata() if m.name == "surgescope.run"]
        expect(len(runs) == 1, f"{len(runs)} metadata records surgescope.run")
        zero_ns = int(runs[0]["time_zero_ns"])

        columns, messages = {}, 0
        modelled = {"model": {}, "residual": {}}
        for channel in summary.channels.values():
            for key in ("sensor", "unit", "kind", "position_m"):
                expect(key in channel.metadata, f"channel {channel.topic} does not say its {key}")
            if summary.schemas[channel.schema_id].name != MODELLED:
                columns.setdefault(channel.metadata["sensor"], [])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            messages += 1
            if schema.name == MODELLED:
                sensor, shows = channel.metadata["sensor"], channel.metadata["shows"]
                expect(channel.topic == f"/{sensor}/{shows}", f"{channel.topic} shows the {shows} of {sensor}")
                modelled[shows].setdefault(sensor, {})[message.log_time - zero_ns] = decoded.value
                continue
            samples = columns[channel.metadata["sensor"]]
            expect(message.log_time == message.publish_time, f"{channel.topic}: log time is not publish time")
            if schema.name == "surgescope.Sample":
                exact = decoded.time_s if decoded.HasField("time_s") else (message.log_time - zero_ns) / 1e9
                expect(abs(exact * 1e9 - (message.log_time - zero_ns)) < 2, f"{channel.topic}: time_s against log time")
                samples.append((exact, decoded.value))
            elif schema.name == "surgescope.Block":
                for i, value in enumerate(decoded.values):
                    # Rounds half up, as the format says; round() of Python would round half to even.
                    offset = int(i * decoded.period_ns + 0.5)
                    regular = (message.log_time + offset - zero_ns) / 1e9
                    samples.append((decoded.times_s[i] if decoded.times_s else regular, value))
        check_model(columns, **modelled)
        expect(messages == summary.statistics.message_count, "the index counts other messages than there are")
    return columns, rigs[0]


def check_model(columns, model, residual):
    """Modelled value and residual stand at times of samples, and make up the sample."""
    expect(model.keys() == residual.keys(), f"models of {sorted(model)}, residuals of {sorted(residual)}")
    for sensor, values in model.items():
        measured = {round(time_s * 1e9): value for time_s, value in columns[sensor]}
        expect(values.keys() == residual[sensor].keys() and values.keys() <= measured.keys(), f"{sensor}: other times than its samples'")
        for time_ns, value in values.items():
            left = measured[time_ns] - value - residual[sensor][time_ns]
            expect(abs(left) <= 1e-9 * max(1, abs(value)), f"{sensor}: model and residual miss the sample at {time_ns} ns by {left}")


def main(mcap_path, csv_path, rig_path=None):
    found, rig = samples_of_mcap(mcap_path)
    wanted = samples_of_csv(csv_path)
    if rig_path:
        with open(rig_path, encoding="utf-8", newline="") as file:
            expect(file.read() == rig, f"the rig file inside is not {rig_path}")
    expect(rig.strip(), "the rig file inside is empty")
    # A sensor that recorded nothing may have no channel.
    sampled = {sensor for sensor, samples in wanted.items() if samples}
    expect(set(found) >= sampled, f"sensors {sorted(found)} for columns {sorted(sampled)}")
    for sensor, samples in found.items():
        expected = wanted.get(sensor, [])
        expect(len(samples) == len(expected), f"{sensor}: {len(samples)} samples for {len(expected)} in the CSV")
        for got, want in zip(samples, expected):
            expect(got == want, f"{sensor}: (time, value) is {got}, but {want} in the CSV")
    print(f"{mcap_path}: {sum(map(len, found.values()))} samples of {len(found)} sensors agree with {csv_path}")


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    try:
        main(*sys.argv[1:])
    except Mismatch as mismatch:
        print(f"{sys.argv[1]}: {mismatch}", file=sys.stderr)
        sys.exit(1)
