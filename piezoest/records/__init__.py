"""Recorded logs in and out: CSV, Parquet, HDF5, MATLAB and NumPy files of time, voltage, displacement."""

from piezoest.records.record import Record, read_record, read_reference
from piezoest.records.stream import Block, RecordStream, stream_record
from piezoest.records.writing import write_columns, writer_for

__all__ = [
    "Block",
    "Record",
    "RecordStream",
    "read_record",
    "read_reference",
    "stream_record",
    "write_columns",
    "writer_for",
]
