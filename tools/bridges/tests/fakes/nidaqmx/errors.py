class DaqError(Exception):
    def __init__(self, message, error_code, task_name=""):
        self.error_code = int(error_code)
        super().__init__(f"{message}\n\nStatus Code: {error_code}")


class DaqReadError(DaqError):
    def __init__(self, message, error_code, samps_per_chan_read, task_name=""):
        super().__init__(message, error_code, task_name)
        self.samps_per_chan_read = samps_per_chan_read
