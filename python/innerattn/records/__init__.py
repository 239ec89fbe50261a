"""What episodes and runs leave behind, written and read. It plays nothing, without torch."""

from innerattn.records.parquet import read_records, write_records
from innerattn.records.record import FIELDS, Record

__all__ = ["FIELDS", "Record", "read_records", "write_records"]
