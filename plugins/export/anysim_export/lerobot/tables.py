"""The Parquet files of LeRobot's data sets: frames, episodes, tasks and sub-tasks."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array

CHUNK_FILES = 1000
"""Files in a chunk's folder."""


def place(number: int) -> tuple[int, int]:
    """Chunk and file of the `number`-th file."""
    return divmod(number, CHUNK_FILES)


def file_name(number: int, ending: str) -> str:
    """`chunk-000/file-000.ENDING`."""
    chunk, file = place(number)
    return f"chunk-{chunk:03d}/file-{file:03d}.{ending}"


def filled(sizes: Sequence[int], most: int) -> list[int]:
    """The number of the file that each part goes into: none of them grows beyond `most` [bytes], unless by one part."""
    files: list[int] = []
    size, number = 0, 0
    for part in sizes:
        if size and size + part > most:
            size, number = 0, number + 1
        size += part
        files.append(number)
    return files


def frame_table(columns: Mapping[str, Array]) -> Any:
    """Rows (n,) or (n, D) by column; those of one number are plain, others lists of fixed size."""
    import pyarrow as pa  # pyright: ignore[reportMissingImports]

    made: dict[str, Any] = {}
    for name, rows in columns.items():
        flat = pa.array(np.ascontiguousarray(rows).reshape(-1))
        wide = rows.ndim == 2 and rows.shape[1] != 1
        made[name] = pa.FixedSizeListArray.from_arrays(flat, rows.shape[1]) if wide else flat
    return pa.table(made)


def beside(table: Any, path: Path) -> Any:
    """A table with the columns of a file of as many rows."""
    import pyarrow.parquet as pq  # pyright: ignore[reportMissingImports]

    more = pq.read_table(path)
    for name in more.column_names:
        table = table.append_column(name, more[name])
    return table


def write_tables(folder: Path, tables: Iterator[Any], files: Sequence[int]) -> None:
    """Write tables, each as a row group of its file."""
    import pyarrow.parquet as pq  # pyright: ignore[reportMissingImports]

    writer: Any = None
    open_file = -1
    try:
        for table, number in zip(tables, files, strict=True):
            if number != open_file:
                if writer is not None:
                    writer.close()
                path = folder / file_name(number, "parquet")
                path.parent.mkdir(parents=True, exist_ok=True)
                writer, open_file = pq.ParquetWriter(path, table.schema, compression="snappy"), number
            writer.write_table(table)
    finally:
        if writer is not None:
            writer.close()


def write_words(path: Path, column: str, words: Sequence[str], index: str) -> None:
    """Numbered words, as pandas writes a frame that has them as its index."""
    import pyarrow as pa  # pyright: ignore[reportMissingImports]
    import pyarrow.parquet as pq  # pyright: ignore[reportMissingImports]

    table = pa.table({column: pa.array(range(len(words)), pa.int64()), index: pa.array(words, pa.string())})
    about = {
        "index_columns": [index],
        "column_indexes": [
            {
                "name": None,
                "field_name": None,
                "pandas_type": "unicode",
                "numpy_type": "object",
                "metadata": {"encoding": "UTF-8"},
            }
        ],
        "columns": [
            {"name": column, "field_name": column, "pandas_type": "int64", "numpy_type": "int64", "metadata": None},
            {"name": None, "field_name": index, "pandas_type": "unicode", "numpy_type": "object", "metadata": None},
        ],
        "attributes": {},
        "pandas_version": "2.2.0",
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table.replace_schema_metadata({b"pandas": json.dumps(about).encode()}), path)


def write_episodes(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """A row for each episode."""
    import pyarrow as pa  # pyright: ignore[reportMissingImports]
    import pyarrow.parquet as pq  # pyright: ignore[reportMissingImports]

    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table({name: [row[name] for row in rows] for name in rows[0]}), path)
