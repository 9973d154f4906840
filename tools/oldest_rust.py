#!/usr/bin/env python3
"""Prints the Rust that the workspace promises, major and minor; fails where its packages differ or one that they use asks for a newer Rust.

    cargo metadata --format-version 1 --all-features --locked | python3 tools/oldest_rust.py
"""

import json
import sys


def number(version):
    return tuple(int(part) for part in version.split(".")[:2])


def main():
    metadata = json.load(sys.stdin)
    members = set(metadata["workspace_members"])
    packages = metadata["packages"]
    stated = {package["rust_version"] for package in packages if package["id"] in members}
    if len(stated) != 1 or None in stated:
        sys.exit(f"the packages of the workspace promise different Rusts: {stated}")
    oldest = stated.pop()
    newer = [f"{p['name']} {p['version']} needs {p['rust_version']}" for p in packages if number(p["rust_version"] or "1.0") > number(oldest)]
    if newer:
        sys.exit(f"Cargo.toml promises Rust {oldest}, but " + ", ".join(newer))
    print(".".join(map(str, number(oldest))))


if __name__ == "__main__":
    main()
