#!/usr/bin/env python3
"""Writes the corpora of the wire protocols (`corpus/frames`, `lines`, `modbus`): `python3 tools/fuzz/wire_corpus.py`.

What the inputs mean stands in `wire.rs` (recipes), `frames.rs` and `modbus.rs`.
"""

import pathlib
import struct

CORPUS = pathlib.Path(__file__).parent / "corpus"


def keep(target, name, data):
    (CORPUS / target).mkdir(parents=True, exist_ok=True)
    (CORPUS / target / name).write_bytes(data)


def piece(kind, data=b""):
    return struct.pack("<BH", kind, len(data)) + data


def frame(sequence, first_us, counts, channels=2, period_ns=500_000):
    samples = len(counts) // channels
    header = struct.pack("<BBHQIH", 1, channels, sequence % 65536, first_us, period_ns, samples)
    return piece(1, header + struct.pack(f"<{len(counts)}h", *counts))


def frames():
    in_order = [frame(i, 2000 * i, [i, -i, 256 * i, 0, 7, 8, 9, 1]) for i in range(8)]
    keep("frames", "in-order", piece(0, b"\0") + b"".join(in_order))
    keep("frames", "joined-in-its-middle", piece(0, b"\5tail\0") + b"".join(in_order[:3]))
    keep("frames", "lost-late-and-twice", b"".join(in_order[i] for i in [0, 1, 4, 2, 4, 5, 5, 7]))
    keep("frames", "restarted", b"".join([frame(900 + i, 10**9 + 2000 * i, [1, 2]) for i in range(3)] + in_order[:5]))
    keep("frames", "wraps", b"".join(frame(65534 + i, 2000 * i, [1, 2], period_ns=1_000_000) for i in range(5)))
    keep("frames", "no-samples", b"".join([in_order[0], frame(1, 2000, []), in_order[2], frame(3, 1, []), in_order[4]]))
    keep("frames", "long", b"".join(frame(i, 10**6 * i, [257] * 600, channels=1) for i in range(3)))
    keep("frames", "noise-between", in_order[0] + piece(0, b"\xff\1\0\0\3ab") + in_order[1] + piece(0, b"\0") + in_order[2])


def lines():
    def rows(times, text=",1.5,-2e3"):
        return "".join(f"{t}{text}\n" for t in times)

    keep("lines", "in-order", ("t\n" + rows(range(0, 500, 10))).encode())
    keep("lines", "comments-and-bad", b"34,0.5\n# a comment\n\n1000,1.5,-2e3\r\n 2000 , 3 , 4 \n3000,x,1\n4000,1\n5000,inf,1\n6000,7,8\n-1,2,3\n")
    keep("lines", "jumps", ("\n" + rows([0, 10, 20, 30, 40, 90, 100, 9110, 120, 130, 200, 270, 340, 410])).encode())
    keep("lines", "restarted", ("\n" + rows([500, 510, 505, 520, 0, 10, 20, 30])).encode())
    keep("lines", "too-long", ("\n" + rows([0, 10]) + "5" * 5000 + "\n" + rows([20, 30])).encode())


def modbus():
    bench = bytes([17, 1, 5, 1])  # unit, input registers, from 5 on, 2 of them
    answered = b"".join([piece(0), piece(1), piece(0), piece(1)] * 6)
    keep("modbus", "answered", bench + answered)
    keep("modbus", "echoes-unknown", bytes([17, 3, 5, 1]) + answered)
    keep("modbus", "refused", bytes([17, 0, 250, 1]) + answered)
    keep("modbus", "late", bench + piece(0) + piece(1) + b"".join([piece(0), piece(7), piece(0), piece(0), piece(1)] * 6))
    keep("modbus", "in-bits", bench + piece(0) + piece(1) + b"".join([piece(0), piece(2, b"123"), piece(2, b"12345"), piece(1)] * 5))
    keep("modbus", "flipped-and-lost", bench + piece(0) + piece(1) + b"".join([piece(0), piece(5, b"\4\1"), piece(1), piece(0), piece(6)] * 5))
    keep("modbus", "twice", bench + piece(0) + piece(1) + b"".join([piece(8), piece(2, b"123456789"), piece(0)] * 12))
    keep("modbus", "noise", bench + piece(0) + piece(1) + piece(0) + piece(4, b"\x11\4\4\0\1\0\2") + piece(3, b"\x11\x84") + piece(1))
    # The example of the specification, section 6.3, and its refusal.
    keep("modbus", "specification", bytes([0x11, 0, 0x6B, 2]) + bytes.fromhex("1103 06AE 4156 5243 4049 AD"))
    keep("modbus", "exception", bytes([0x11, 0, 0x6B, 2]) + bytes.fromhex("118302"))
    keep("modbus", "echo", bytes([0x11, 0, 0xA5, 0x37]) + bytes.fromhex("11080000A537"))


frames()
lines()
modbus()
