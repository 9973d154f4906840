"""A fake of nidaqmx: a task with a buffer that is overwritten where nobody reads."""
from fake_device import Device

from nidaqmx.constants import AcquisitionType, Edge, OverwriteMode, ReadRelativeTo, TerminalConfiguration, VoltageUnits
from nidaqmx.errors import DaqError


class AIChannelCollection:
    def __init__(self, task):
        self.task = task

    def add_ai_voltage_chan(
        self, physical_channel, name_to_assign_to_channel="", terminal_config=TerminalConfiguration.DEFAULT, min_val=-5.0,
        max_val=5.0, units=VoltageUnits.VOLTS, custom_scale_name="",
    ):
        if not physical_channel.startswith("Dev1/ai"):
            raise DaqError("Device identifier is invalid.", -200220)
        self.task.channels.append(int(physical_channel.removeprefix("Dev1/ai")))


class Timing:
    samp_clk_rate = 0.0

    def __init__(self, task):
        self.task = task

    def cfg_samp_clk_timing(
        self, rate, source="", active_edge=Edge.RISING, sample_mode=AcquisitionType.FINITE, samps_per_chan=1000
    ):
        assert sample_mode == AcquisitionType.CONTINUOUS
        self.samp_clk_rate, self.task.in_stream.input_buf_size = float(rate), samps_per_chan


class InStream:
    overwrite = OverwriteMode.DO_NOT_OVERWRITE_UNREAD_SAMPLES
    relative_to = ReadRelativeTo.CURRENT_READ_POSITION
    offset = 0
    curr_read_pos = 0
    input_buf_size = 0

    def __init__(self, task):
        self.task = task


class Task:
    def __init__(self, new_task_name=""):
        self.channels = []
        self.ai_channels, self.timing, self.in_stream = AIChannelCollection(self), Timing(self), InStream(self)

    def __enter__(self):
        return self

    def __exit__(self, type, value, traceback):
        self.close()

    def start(self):
        self.device = Device(self.timing.samp_clk_rate)

    def close(self):
        pass
