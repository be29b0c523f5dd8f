"""Recorded logs in and out: text, LabVIEW, TDMS, Parquet, HDF5, MATLAB, NumPy, spreadsheets, DataFrames."""

from piezoest.records.as_record import as_record
from piezoest.records.record import Record, example_log, read_record, read_reference
from piezoest.records.stream import Block, RecordStream, stream_record
from piezoest.records.writing import write_columns, writer_for

__all__ = [
    "Block", "Record", "RecordStream", "as_record", "example_log", "read_record", "read_reference",
    "stream_record", "write_columns", "writer_for",
]  # fmt: skip
