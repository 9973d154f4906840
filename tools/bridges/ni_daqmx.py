"""NI's devices: acquires voltages continuously with NI-DAQmx (`pip install nidaqmx`, and NI's driver).

    [[device]]
    name = "daq"
    protocol = "frames"
    command = ["python3", "ni_daqmx.py", "--channels", "Dev1/ai0,Dev1/ai1,Dev1/ai2", "--rate", "20000", "--range", "10"]

Where this computer was too slow and samples were overwritten before they were read (error -200279), reading goes on with the newest ones:
the driver says their number, so the gap is exact. What ends the acquisition (the device's own buffer ran over, a device that was
unplugged) ends this program with code 1; the recorder starts it again, and the time between is a gap.
"""
import nidaqmx
import numpy
from nidaqmx.constants import AcquisitionType, OverwriteMode, ReadRelativeTo, TerminalConfiguration
from nidaqmx.errors import DaqReadError
from nidaqmx.stream_readers import AnalogMultiChannelReader

from frames import Sender, options, run, running, say

OVERWRITTEN = -200279
NOT_YET = -200284
BUFFER_S = 10
"""What the driver keeps until it is read, s."""
PATIENCE_S = 5
"""A clock that gives no sample for so long has stopped."""


def main():
    chosen = options(
        "Acquires voltages of NI devices as frames.",
        "such as Dev1/ai0,Dev1/ai1",
        terminals={"default": "DEFAULT", "choices": [name for name in TerminalConfiguration.__members__], "help": "how they are wired"},
        clock={"default": "", "help": "terminal of an outer sample clock"},
    )
    width = len(chosen.channels)
    scans_a_read = max(1, round(chosen.rate / 50))
    with nidaqmx.Task() as task:
        for name in chosen.channels:
            task.ai_channels.add_ai_voltage_chan(
                name, terminal_config=TerminalConfiguration[chosen.terminals], min_val=-chosen.range, max_val=chosen.range
            )
        task.timing.cfg_samp_clk_timing(
            chosen.rate,
            source=chosen.clock,
            sample_mode=AcquisitionType.CONTINUOUS,
            samps_per_chan=max(round(BUFFER_S * chosen.rate), 2 * scans_a_read),
        )
        task.in_stream.overwrite = OverwriteMode.OVERWRITE_UNREAD_SAMPLES
        task.start()
        sender = Sender(width, task.timing.samp_clk_rate, chosen.range)
        try:
            acquire(task, sender, numpy.zeros((width, scans_a_read)))
        finally:
            sender.flush()


def acquire(task, sender, data):
    """Reads until an error that ends the acquisition."""
    reader = AnalogMultiChannelReader(task.in_stream)
    scans_a_read = data.shape[1]
    waited_s = 0
    while running():
        timeout_s = max(1.0, 2 * scans_a_read / sender.rate_hz)
        try:
            scans = reader.read_many_sample(data, number_of_samples_per_channel=scans_a_read, timeout=timeout_s)
        except DaqReadError as error:
            if error.error_code == OVERWRITTEN:
                say("samples were overwritten before they were read: this computer is too slow for the rate")
                go_to(task, ReadRelativeTo.MOST_RECENT_SAMPLE, -scans_a_read)
                continue
            if error.error_code != NOT_YET:
                raise
            # what came before the time was over is read
            scans = error.samps_per_chan_read
            waited_s = 0 if scans else waited_s + timeout_s
            if waited_s >= PATIENCE_S:
                raise
        else:
            waited_s = 0
        if scans:
            go_to(task, ReadRelativeTo.CURRENT_READ_POSITION, 0)
            first = task.in_stream.curr_read_pos - scans
            sender.send(first, data[:, :scans].T.ravel().tolist())


def go_to(task, place, offset):
    """The next read begins so many samples from a place."""
    task.in_stream.relative_to, task.in_stream.offset = place, offset


if __name__ == "__main__":
    run(main)
