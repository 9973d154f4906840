from enum import Enum


class AcquisitionType(Enum):
    FINITE = 10178
    CONTINUOUS = 10123


class Edge(Enum):
    RISING = 10280


class OverwriteMode(Enum):
    OVERWRITE_UNREAD_SAMPLES = 10252
    DO_NOT_OVERWRITE_UNREAD_SAMPLES = 10159


class ReadRelativeTo(Enum):
    CURRENT_READ_POSITION = 10425
    MOST_RECENT_SAMPLE = 10428


class TerminalConfiguration(Enum):
    RSE = 10083
    NRSE = 10078
    DIFF = 10106
    DEFAULT = -1


class VoltageUnits(Enum):
    VOLTS = 10348
