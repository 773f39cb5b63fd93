"""Comparisons of finished runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _heba
from ._arguments import PathLike, folder_of, rows_of
from ._heba import Error
from ._result import Result


@dataclass(frozen=True)
class Comparison:
    """What finished runs have in common.

    Attributes:
        runs: The rows of compare.csv: a camera of a run each, with its figures.
        pairs: The rows of pairs.csv: the difference of a pose between two runs each, with its sigmas.
        table: What `heba compare` prints.
    """

    runs: tuple[dict[str, Any], ...]
    pairs: tuple[dict[str, Any], ...]
    table: str


def compare(*runs: PathLike | Result, out: PathLike | None = None) -> Comparison:
    """Compares finished runs, as `heba compare` does.

    Args:
        runs: Folders of runs or of batches, or results of runs.
        out: A new folder, in which compare.csv, pairs.csv and compare.html are written.
    """
    if not runs:
        raise Error("runs: compare needs at least one run, or the folder of a batch")
    folders = [folder_of(run, "compare") for run in runs]
    table, of_runs, of_pairs = _heba.compare(folders, None if out is None else Path(out))
    return Comparison(rows_of(of_runs), rows_of(of_pairs), table)
