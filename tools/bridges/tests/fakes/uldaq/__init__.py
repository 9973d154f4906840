"""A fake of uldaq: a background scan into a ring that goes round whether or not anybody reads it."""
from ctypes import c_double
from enum import IntEnum

from fake_device import Device, volts


class ULError(IntEnum):
    NO_ERROR = 0
    DEV_NOT_CONNECTED = 7
    DEAD_DEV = 8
    OVERRUN = 18


class InterfaceType(IntEnum):
    ANY = 7


class AiInputMode(IntEnum):
    DIFFERENTIAL = 1
    SINGLE_ENDED = 2


class Range(IntEnum):
    BIP10VOLTS = 5
    BIP5VOLTS = 6
    BIP2PT5VOLTS = 8
    BIPPT5VOLTS = 13


class ScanOption(IntEnum):
    DEFAULTIO = 0
    CONTINUOUS = 8


class AInScanFlag(IntEnum):
    DEFAULT = 0


class ScanStatus(IntEnum):
    IDLE = 0
    RUNNING = 1


class ULException(Exception):
    def __init__(self, error_code):
        self.error_code = ULError(error_code)
        super().__init__(f"{self.error_code!r}")


class TransferStatus:
    def __init__(self, scans, width, ring):
        self.current_scan_count = scans
        self.current_total_count = scans * width
        self.current_index = (scans % ring) * width - 1


class DaqDeviceDescriptor:
    product_name = "FAKE-1608"
    unique_id = "01F4A2B3"


def get_daq_device_inventory(interface_type, number_of_devices=100):
    return [DaqDeviceDescriptor()]


def create_float_buffer(number_of_channels, samples_per_channel):
    return (c_double * (number_of_channels * samples_per_channel))()


class AiDevice:
    def a_in_scan(self, low_channel, high_channel, input_mode, analog_range, samples_per_channel, rate, options, flags, data):
        assert options == ScanOption.CONTINUOUS and analog_range == Range.BIP10VOLTS
        self.channels, self.ring, self.data = range(low_channel, high_channel + 1), samples_per_channel, data
        self.device, self.written = Device(rate), 0
        return float(rate)

    def get_scan_status(self):
        code = self.device.failure(self.written)
        if code:
            raise ULException(code)
        come, width = self.device.come(), len(self.channels)
        for scan in range(max(self.written, come - self.ring), come):
            for i, channel in enumerate(self.channels):
                self.data[scan % self.ring * width + i] = volts(channel, scan)
        self.written = come
        return ScanStatus.RUNNING, TransferStatus(come, width, self.ring)

    def scan_stop(self):
        code = self.device.failure(self.written)
        if code:
            raise ULException(code)


class DaqDevice:
    def __init__(self, daq_device_descriptor):
        self.inputs = AiDevice()

    def connect(self, connection_code=0):
        pass

    def get_ai_device(self):
        return self.inputs

    def disconnect(self):
        pass

    def release(self):
        pass
