"""Recorded logs in and out: CSV, Parquet, HDF5, MATLAB and NumPy files of time, voltage, displacement."""

from piezoest.records.record import Record, read_record, read_reference, write_columns
from piezoest.records.stream import Block, RecordStream, stream_record

__all__ = [
    "Block",
    "Record",
    "RecordStream",
    "read_record",
    "read_reference",
    "stream_record",
    "write_columns",
]
