"""What the bridges share: volts become `frames` on standard output, and what a device lost becomes a gap in them.

The wire format stands in the guide, page "Wire protocols". Only Python's own library is needed.
"""
import argparse
import binascii
import signal
import struct
import sys
from array import array

MOST_BYTES = 60_000
"""Of a frame's samples: its length stays well below what a reader takes."""


def cobs(data):
    """Consistent overhead byte stuffing: the same bytes without a zero, ended by one."""
    out = bytearray()
    for block in data.split(b"\0"):
        while len(block) >= 254:
            out += b"\xff" + block[:254]
            block = block[254:]
        out.append(len(block) + 1)
        out += block
    return bytes(out) + b"\0"


def frame(sequence, first_us, period_ns, channels, counts):
    """One frame; `counts` is an array of 16-bit numbers, interleaved by channel."""
    head = struct.pack("<BBHQIH", 1, channels, sequence & 0xFFFF, first_us, period_ns, len(counts) // channels)
    counts = array("h", counts)
    if sys.byteorder == "big":
        counts.byteswap()
    body = head + counts.tobytes()
    return cobs(body + struct.pack("<H", binascii.crc_hqx(body, 0xFFFF)))


class Sender:
    """Sends scans (a sample of each channel) that are counted from the start of the device: a number that is left out is a gap."""

    def __init__(self, channels, rate_hz, full_scale_v, out=None):
        self.channels, self.rate_hz, self.volts_a_count = channels, rate_hz, full_scale_v / 32767
        self.out = out or sys.stdout.buffer
        self.period_ns = round(1e9 / rate_hz)
        self.scans_a_frame = max(1, min(round(rate_hz / 100), MOST_BYTES // (2 * channels)))
        self.sequence = self.first = 0
        self.pending = array("h")
        self.lost = self.clipped = 0
        say(f"{channels} channels at {rate_hz:g} Hz; in the rig file: scale = (sensor's unit per volt) x {self.volts_a_count:.6g}")

    def send(self, first, volts):
        """Takes scans, the first of them of number `first`; `volts` are interleaved by channel."""
        expected = self.first + len(self.pending) // self.channels
        if first < expected:
            raise ValueError(f"scan {first} came after scan {expected - 1}")
        if first > expected:
            self.flush()
            lost = first - self.first
            # as many numbers are left out as the lost scans would have filled frames: more would say that the stamp after them is too
            # early; what fills none shows in the stamp alone
            self.sequence += lost // self.scans_a_frame
            self.first = first
            self.lost += lost
            say(f"{lost} scans lost before scan {first}: a gap is recorded")
        for volt in volts:
            count = round(volt / self.volts_a_count)
            if not -32768 <= count <= 32767:
                count = max(-32768, min(32767, count))
                self.clipped += 1
                if self.clipped == 1:
                    say("a voltage lies beyond --range: it is recorded as the end of it")
            self.pending.append(count)
        size = self.scans_a_frame * self.channels
        while len(self.pending) >= size:
            self.put(self.pending[:size])
            del self.pending[:size]
        self.out.flush()

    def flush(self):
        """Sends what does not fill a frame."""
        if self.pending:
            self.put(self.pending)
            self.pending = array("h")
            self.out.flush()

    def put(self, counts):
        first_us = round(self.first * 1e6 / self.rate_hz)
        self.out.write(frame(self.sequence, first_us, self.period_ns, self.channels, counts))
        self.sequence += 1
        self.first += len(counts) // self.channels


def say(text):
    """For people: the recorder shows it and keeps it with the recording."""
    print(text, file=sys.stderr, flush=True)


def options(about, channels, **more):
    """What every bridge is told on its command line; `more` are options of its own with their help."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--channels", required=True, help=channels)
    parser.add_argument("--rate", type=float, required=True, help="scans a second")
    parser.add_argument("--range", type=float, required=True, help="volts, such as 10 for -10 to 10 V")
    for name, words in more.items():
        parser.add_argument("--" + name.replace("_", "-"), **words)
    chosen = parser.parse_args()
    if chosen.rate <= 0 or chosen.range <= 0:
        parser.error("--rate and --range must be above 0")
    chosen.channels = [name.strip() for name in chosen.channels.split(",")]
    return chosen


_asked_to_end = []


def running():
    """False once the recorder has asked the bridge to end: it looks between two reads, so that no frame is cut or sent twice."""
    return not _asked_to_end


def run(main):
    """Runs a bridge until the recorder ends it; a fault of the device is said, and ends it with code 1, so that it is started again."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda number, _: _asked_to_end.append(number))
    try:
        main()
    except BrokenPipeError:
        # The recorder is gone. Nothing more can be written, not even at the end.
        sys.stdout = None
    except Exception as error:
        say(f"{type(error).__name__}: {error}")
        raise SystemExit(1)
