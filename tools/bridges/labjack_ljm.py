"""LabJack T4, T7 and T8 as a device: streams analog inputs with LabJack's LJM library (`pip install labjack-ljm`, and LJM itself).

    [[device]]
    name = "daq"
    protocol = "frames"
    command = ["python3", "labjack_ljm.py", "--channels", "AIN0,AIN1,AIN2", "--rate", "20000", "--range", "10"]

Where the device could not send fast enough it goes on by itself and LJM fills the hole with -9999 in every channel: these scans become a
gap. Whatever ends the stream (the computer was too slow for LJM's buffer, a cable that came off) ends this program with code 1; the
recorder starts it again, and the time between is a gap.
"""
from labjack import ljm
from labjack.ljm import constants

from frames import Sender, options, run, running, say


def main():
    chosen = options(
        "Streams a LabJack's analog inputs as frames.",
        "such as AIN0,AIN1",
        device={"default": "ANY", "help": "T4, T7 or T8"},
        connection={"default": "ANY", "help": "USB, ETHERNET or WIFI"},
        identifier={"default": "ANY", "help": "serial number, IP address or name"},
        settling_us={"type": float, "default": 0, "help": "settling time, us; 0: the device chooses"},
    )
    handle = ljm.openS(chosen.device, chosen.connection, chosen.identifier)
    try:
        stream(handle, chosen)
    finally:
        stop(handle)


def stream(handle, chosen):
    width = len(chosen.channels)
    for name in chosen.channels:
        ljm.eWriteName(handle, f"{name}_RANGE", chosen.range)
    ljm.eWriteName(handle, "STREAM_SETTLING_US", chosen.settling_us)
    ljm.eWriteName(handle, "STREAM_RESOLUTION_INDEX", 0)
    addresses = ljm.namesToAddresses(width, chosen.channels)[0]
    # fifty reads a second: what waits here is lost when the recorder is killed
    scans_a_read = max(1, round(chosen.rate / 50))
    rate_hz = ljm.eStreamStart(handle, scans_a_read, width, addresses, chosen.rate)
    sender = Sender(width, rate_hz, chosen.range)
    first = 0
    behind = False
    try:
        while running():
            volts, device_backlog, ljm_backlog = ljm.eStreamRead(handle)
            send(sender, first, volts, width)
            first += scans_a_read
            lags = max(device_backlog, ljm_backlog) > rate_hz
            if lags and not behind:
                say(f"over a second of scans waits ({device_backlog} in the device, {ljm_backlog} in LJM): this computer is too slow for the rate")
            behind = lags
    finally:
        sender.flush()


def send(sender, first, volts, width):
    """Sends the scans that were taken; one with a dummy was skipped."""
    began = None
    for scan in range(len(volts) // width):
        skipped = constants.DUMMY_VALUE in volts[scan * width:(scan + 1) * width]
        if began is None and not skipped:
            began = scan
        if began is not None and skipped:
            sender.send(first + began, volts[began * width:scan * width])
            began = None
    if began is not None:
        sender.send(first + began, volts[began * width:])


def stop(handle):
    """Stops the stream, so that the next start finds the device ready; one that is gone cannot be stopped."""
    for end in (ljm.eStreamStop, ljm.close):
        try:
            end(handle)
        except ljm.LJMError:
            pass


if __name__ == "__main__":
    run(main)
