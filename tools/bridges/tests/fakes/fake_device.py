"""The device behind the fakes of the vendors' modules: channels that count scans in real time, and what goes wrong with it by the variable
FAKE, a JSON object: `jump` [scan, scans] (the computer stands still for so many scans), `skip` [[scan, scans], …] (the device cannot
send these), `fail` [scan, code] (an error of the vendor's, from that scan on), `pause` [scan, s] (the sample clock stops for a while),
`once` a file: what goes wrong does so only while it is not there."""
import json
import os
import time

SLOPES = (1, 3, -7)
FULL_SCALE_V = 10.0
# Scans that are lost with a device: a read of LJM's is 40 of them.
UNDER_WAY = 60


def count(channel, scan):
    """What a channel shows at a scan, as a 16-bit number that tells which scan it is."""
    return (SLOPES[channel] * scan + 32768) % 65536 - 32768


def volts(channel, scan):
    return count(channel, scan) * FULL_SCALE_V / 32767


class Device:
    def __init__(self, rate_hz):
        self.rate_hz = rate_hz
        self.started = time.monotonic()
        self.script = json.loads(os.environ.get("FAKE", "{}"))
        once = self.script.get("once")
        if once and os.path.exists(once):
            self.script = {}
        elif once:
            open(once, "w").close()

    def come(self):
        """How many scans were taken by now."""
        since_s = time.monotonic() - self.started
        scan, pause_s = self.script.get("pause", [0, 0])
        begin_s = scan / self.rate_hz
        if since_s > begin_s:
            since_s = max(begin_s, since_s - pause_s)
        come = int(since_s * self.rate_hz)
        scan, scans = self.script.get("jump", [0, 0])
        return come + scans if come >= scan else come

    def wait_for(self, scan, timeout_s=60.0):
        """Waits until scans up to this one were taken; false where that takes too long."""
        until = time.monotonic() + timeout_s
        while self.come() < scan:
            if time.monotonic() > until:
                return False
            time.sleep(0.001)
        return True

    def failure(self, read):
        """The vendor's error code, once the device has failed and the program has read all but what was under way: however slow this computer is,
        it then has what it should have."""
        scan, code = self.script.get("fail", [None, None])
        return code if scan is not None and self.come() >= scan and read >= scan - UNDER_WAY else None

    def skipped(self, scan):
        return any(first <= scan < first + scans for first, scans in self.script.get("skip", []))
