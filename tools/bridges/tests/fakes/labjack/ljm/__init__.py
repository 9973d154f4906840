"""A fake of LJM: scans of a fixed number a read, -9999 in scans that the device skipped, backlogs, and an error that stops the stream."""
from fake_device import Device, volts

from . import constants, errorcodes

_streams = {}


class LJMError(Exception):
    def __init__(self, errorCode=None, errorAddress=None, errorString=None):
        self.errorCode = errorCode
        super().__init__(f"LJM library error code {errorCode} {errorString or ''}".strip())


def openS(deviceType="ANY", connectionType="ANY", identifier="ANY"):
    return 1


def close(handle):
    _streams.pop(handle, None)


def eWriteName(handle, name, value):
    if not isinstance(name, str):
        raise TypeError("name is not a string")


def namesToAddresses(numFrames, aNames, aAddresses=None, aDataTypes=None):
    return [2 * int(name[3:]) for name in aNames[:numFrames]], [3] * numFrames


def eStreamStart(handle, scansPerRead, numAddresses, aScanList, scanRate):
    _streams[handle] = {"device": Device(scanRate), "scans": scansPerRead, "channels": [address // 2 for address in aScanList], "read": 0}
    return float(scanRate)


def eStreamRead(handle):
    if handle not in _streams:
        raise LJMError(errorString="Streaming has not been started for the given handle. Please call eStreamStart first.")
    stream = _streams[handle]
    device, first, end = stream["device"], stream["read"], stream["read"] + stream["scans"]
    device.wait_for(end)
    code = device.failure(first)
    if code:
        # LJM stops the stream
        del _streams[handle]
        raise LJMError(code)
    stream["read"] = end
    dummy = float(constants.DUMMY_VALUE)
    data = [dummy if device.skipped(scan) else volts(channel, scan) for scan in range(first, end) for channel in stream["channels"]]
    return data, 0, max(0, device.come() - end)


def eStreamStop(handle):
    if _streams.pop(handle, None) is None:
        raise LJMError(errorcodes.STREAM_NOT_RUNNING)
