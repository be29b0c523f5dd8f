"""Recorded logs in and out: CSV files with time, voltage and displacement."""

from piezoest.records.record import Record, read_record, read_reference, write_columns

__all__ = ["Record", "read_record", "read_reference", "write_columns"]
