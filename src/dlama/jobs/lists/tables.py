"""A job list as CSV, JSONL or Parquet in; its rows out, one at a time."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from typing import Any

from dlama.errors import FileError, InputError, first_line, import_extra
from dlama.files.fields import json_value
from dlama.jobs.job import check_columns
from dlama.jobs.storage import open_to_read

Row = tuple[str, Mapping[str, Any]]
"""Where it stands (`jobs.csv: line 7`), and its values."""


def rows(path: str) -> Iterator[Row]:
    """The rows of a list. FileError: no such file, not what its name says, or no row; InputError: a column that no verb knows."""
    suffix = path.rpartition(".")[2].lower()
    if suffix not in READERS:
        raise FileError(f"{path}: is no job list; a name that ends in .{', .'.join(READERS)} is expected")
    empty = True
    for row in READERS[suffix](path):
        empty = False
        yield row
    if empty:
        raise FileError(f"{path}: lists no job; one row or more is expected")


def _csv_rows(path: str) -> Iterator[Row]:
    with open_to_read(path) as stream:
        reader = csv.reader(stream)
        try:
            header = _csv_header(f"{path}: line 1", next(reader, []))
            for line in reader:
                if any(value.strip() for value in line):  # a cleared row of a spreadsheet is commas alone
                    yield _csv_row(f"{path}: line {reader.line_num}", header, line)
        except csv.Error as error:
            raise FileError(f"{path}: line {reader.line_num} is no CSV: {error}") from error


def _csv_header(where: str, line: list[str]) -> list[str]:
    header = [name.strip() for name in line]
    for other, named in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and other in header[0]:
            raise FileError(f"{where}: values are separated by {named}; commas are expected")
    check_columns(header, where)
    twice = [name for name in header if header.count(name) > 1]
    if twice:
        raise InputError(f"{where} has column {twice[0]!r} twice")
    return header


def _csv_row(where: str, header: list[str], line: list[str]) -> Row:
    if len(line) != len(header):
        raise FileError(f"{where}: has {len(line)} values; {len(header)} are expected, one a column")
    return where, dict(zip(header, (value.strip() for value in line)))


def _json_rows(path: str) -> Iterator[Row]:
    with open_to_read(path) as stream:
        for number, line in enumerate(stream, 1):
            if not line.strip():
                continue
            where = f"{path}: line {number}"
            row = json_value(where, line)
            if not isinstance(row, dict):
                raise FileError(f"{where}: is {type(row).__name__}; an object with id, verb and parameters is expected")
            check_columns(list(row), where)
            yield where, row


def _parquet_rows(path: str) -> Iterator[Row]:
    arrow, parquet = (import_extra(name, path, "pyarrow", "batch") for name in ("pyarrow", "pyarrow.parquet"))
    with open_to_read(path, "rb") as stream:
        try:
            table = parquet.ParquetFile(stream)
            check_columns(list(table.schema_arrow.names), path)
            number = 0
            for batch in table.iter_batches(4096):
                for row in batch.to_pylist():
                    number += 1
                    yield f"{path}: row {number}", row
        except arrow.ArrowException as error:
            raise FileError(f"{path}: is no Parquet file: {first_line(error)}") from error


READERS = {"csv": _csv_rows, "jsonl": _json_rows, "ndjson": _json_rows, "parquet": _parquet_rows}
"""Suffix -> what reads it."""
