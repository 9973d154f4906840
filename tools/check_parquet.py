#!/usr/bin/env python3
"""Checks the Parquet files of the workbench with pyarrow, against the CSV of the same curves.

    python3 -m venv venv && venv/bin/pip install pyarrow
    venv/bin/python tools/check_parquet.py SURGESCOPE RECORDING

Opens the recording in the workbench, fetches the curves of its first sensor both ways, and compares names, numbers of rows and every value.
Exit code 0 when all agrees, 1 with what does not.
"""

import csv
import io
import json
import math
import subprocess
import sys
import urllib.request

import pyarrow.parquet


def fetch(address, path, token):
    request = urllib.request.Request(address + path, headers={"Authorization": f"Bearer {token}"})
    with urllib.request.urlopen(request, timeout=120) as answer:
        return answer.read()


def main(program, recording):
    serving = subprocess.Popen([program, "open", recording, "--no-browser", "--json"], stdout=subprocess.PIPE, text=True)
    try:
        first = json.loads(serving.stdout.readline())
        address = first["url"].split("/?")[0]
        # the first action waits for the first fit; a query does not
        while json.loads(fetch(address, "/api/state", first["token"]))["model"] is None:
            pass
        query = "?points=5000&curves=model"
        table = pyarrow.parquet.read_table(io.BytesIO(fetch(address, "/api/curves.parquet" + query, first["token"])))
        rows = list(csv.reader(io.StringIO(fetch(address, "/api/curves.csv" + query, first["token"]).decode())))
    finally:
        serving.terminate()
        serving.wait()
    heading, *rows = rows
    if table.column_names != heading:
        return f"columns {table.column_names} are not {heading}"
    if table.num_rows != len(rows) or not rows:
        return f"{table.num_rows} rows are not {len(rows)}"
    for name, cells in zip(heading, zip(*rows)):
        for i, (value, cell) in enumerate(zip(table[name].to_pylist(), cells)):
            same = math.isnan(value) if cell == "" else value == float(cell)
            if not same:
                return f"row {i} of {name}: {value} is not {cell}"
    print(f"{len(rows)} rows of {', '.join(heading)}, the same in both")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
