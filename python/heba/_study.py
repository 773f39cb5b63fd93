"""Studies of simulated trials."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Mapping

from . import _heba
from ._arguments import PathLike, config_file, interruptible, rows_of, threads_of
from ._plots import plot_study


@dataclass(frozen=True)
class Study:
    """The errors of methods over simulated trials, beside the least possible ones.

    Attributes:
        rows: The rows of study.csv: a method in a cell of the study each, lengths in mm, angles in deg.
        table: What `heba study` prints.
    """

    rows: tuple[dict[str, Any], ...]
    table: str

    def plot(self, x: str, y: str, axes: Any = None) -> Any:
        """Draws a column of the rows over another one, a line for each method, and returns matplotlib's axes."""
        return plot_study(self, x, y, axes)


def study(
    config: PathLike | Mapping[str, Any], *, out: PathLike | None = None, threads: int | None = None
) -> Study:
    """Runs a study, as `heba study` does.

    Args:
        config: The path of the study's config, or its contents as a dictionary; paths in it are then relative to the
            current folder.
        out: A folder in which the study is written, too.
        threads: As in run.
    """
    folder = None if out is None else Path(out).absolute()
    with config_file(config) as file:
        table, rows = interruptible(lambda cancel: _heba.study(file, folder, threads_of(threads), cancel))
    return Study(rows_of(rows), table)
