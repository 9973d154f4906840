from fake_device import volts

from nidaqmx.constants import OverwriteMode, ReadRelativeTo
from nidaqmx.errors import DaqReadError

READ_ALL_AVAILABLE = -1


class AnalogMultiChannelReader:
    def __init__(self, task_in_stream):
        self.stream = task_in_stream

    def read_many_sample(self, data, number_of_samples_per_channel=READ_ALL_AVAILABLE, timeout=10.0):
        stream, task = self.stream, self.stream.task
        device, scans = task.device, number_of_samples_per_channel
        assert data.shape == (len(task.channels), scans)
        newest = stream.relative_to == ReadRelativeTo.MOST_RECENT_SAMPLE
        first = (device.come() if newest else stream.curr_read_pos) + stream.offset
        in_time = device.wait_for(first + scans, timeout)
        code = device.failure(first)
        if code:
            raise DaqReadError("The device does not answer.", code, 0)
        if device.come() - first > stream.input_buf_size:
            if stream.overwrite == OverwriteMode.DO_NOT_OVERWRITE_UNREAD_SAMPLES:
                raise AssertionError("the acquisition would have stopped")
            raise DaqReadError("Attempted to read samples that are no longer available.", -200279, 0)
        come = scans if in_time else min(scans, device.come() - first)
        for row, channel in enumerate(task.channels):
            data[row, :come] = [volts(channel, scan) for scan in range(first, first + come)]
        stream.curr_read_pos = first + come
        if not in_time:
            raise DaqReadError("Some or all of the samples requested have not yet been acquired.", -200284, come)
        return come
