"""MCC's devices (Measurement Computing, Linux and macOS): scans analog inputs with `uldaq` (`pip install uldaq`, and its C library).

    [[device]]
    name = "daq"
    protocol = "frames"
    command = ["python3", "mcc_uldaq.py", "--channels", "0,1,2", "--rate", "20000", "--range", "10"]

The library fills a ring of some seconds. Where this program was too slow and the ring went round, the scans that were overwritten become a
gap: their number is known. A device whose own buffer ran over (OVERRUN), or that was unplugged, ends this program with code 1; the
recorder starts it again, and the time between is a gap.
"""
import contextlib
import time

import uldaq

from frames import Sender, options, run, running, say

RING_S = 10
"""What the ring holds, s."""
LOOK_EVERY_S = 0.01
PATIENCE_S = 5
"""A scan that brings nothing for so long has stopped."""


def main():
    chosen = options(
        "Scans analog inputs of MCC devices as frames.",
        "neighbours, such as 0,1,2",
        device={"default": "", "help": "its unique id, where there are several"},
        inputs={"default": "SINGLE_ENDED", "choices": ["SINGLE_ENDED", "DIFFERENTIAL"], "help": "how they are wired"},
    )
    numbers = [int(name) for name in chosen.channels]
    if numbers != list(range(numbers[0], numbers[-1] + 1)):
        raise SystemExit(f"--channels must be neighbours in rising order, such as 0,1,2, not {','.join(chosen.channels)}")
    device = uldaq.DaqDevice(found(chosen.device))
    device.connect()
    try:
        scan(device.get_ai_device(), numbers, chosen)
    finally:
        with contextlib.suppress(uldaq.ULException):
            device.disconnect()
            device.release()


def found(unique_id):
    """The device of that id, or the only one."""
    devices = uldaq.get_daq_device_inventory(uldaq.InterfaceType.ANY)
    named = [device for device in devices if unique_id in ("", device.unique_id)]
    if len(named) != 1:
        listed = ", ".join(f"{device.product_name} {device.unique_id}" for device in devices) or "none"
        raise SystemExit(f"name one device with --device: there are {listed}")
    return named[0]


def scan(inputs, numbers, chosen):
    width = len(numbers)
    ring = max(round(RING_S * chosen.rate), 1000)
    data = uldaq.create_float_buffer(width, ring)
    mode, span = uldaq.AiInputMode[chosen.inputs], volts(chosen.range)
    rate_hz = inputs.a_in_scan(
        numbers[0], numbers[-1], mode, span, ring, chosen.rate, uldaq.ScanOption.CONTINUOUS, uldaq.AInScanFlag.DEFAULT, data
    )
    sender = Sender(width, rate_hz, chosen.range)
    try:
        follow(inputs, data, ring, width, sender)
    finally:
        sender.flush()
        # one that is gone cannot be stopped
        with contextlib.suppress(uldaq.ULException):
            inputs.scan_stop()


def volts(range_v):
    """The library's name of a range from -range_v to range_v."""
    name = f"BIP{range_v:g}VOLTS".replace("BIP0.", "BIPPT").replace(".", "PT")
    if name not in uldaq.Range.__members__:
        raise SystemExit(f"--range {range_v:g} is no range of the library, such as 10, 5, 2.5 or 1: look which your device has")
    return uldaq.Range[name]


def follow(inputs, data, ring, width, sender):
    """Sends what comes into the ring, until the scan ends."""
    read, since = 0, time.monotonic()
    while running():
        status, transfer = inputs.get_scan_status()
        # a scan of which not all channels have come yet does not count
        come = transfer.current_total_count // width
        if come - read > ring:
            say("scans were overwritten before they were read: this computer is too slow for the rate")
            read = come - ring // 2
        if come > read:
            since = time.monotonic()
            taken = copied(data, ring, width, read, come)
            failure, written = None, come
            try:
                written = inputs.get_scan_status()[1].current_total_count // width
            except uldaq.ULException as error:
                # a scan that has failed overwrites nothing more
                failure = error
            # what was overwritten while it was copied is not what it was
            first = max(read, written + 1 - ring)
            if first < come:
                sender.send(first, taken[(first - read) * width:])
            read = come
            if failure:
                raise failure
        if status != uldaq.ScanStatus.RUNNING:
            raise RuntimeError("the scan has ended by itself")
        if time.monotonic() - since > PATIENCE_S:
            raise RuntimeError(f"no scan came for {PATIENCE_S} s")
        time.sleep(LOOK_EVERY_S)


def copied(data, ring, width, first, end):
    """Scans from a number up to another, out of the ring."""
    begin, stop = first % ring * width, end % ring * width
    return data[begin:stop] if begin < stop else data[begin:] + data[:stop]


if __name__ == "__main__":
    run(main)
