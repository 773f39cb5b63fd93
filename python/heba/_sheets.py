"""Printed sheets of targets."""

from __future__ import annotations

import json
import os
import warnings
from pathlib import Path
from typing import Any, Mapping

from . import _heba
from ._arguments import PathLike


def target(
    target: PathLike | Mapping[str, Any], out: PathLike, *, paper: str | None = None, dpi: float = 300
) -> Path:
    """Writes the printed sheet of a target, as `heba target` does, and returns the file with the positions of its points.

    Args:
        target: The path of the target's file, or its keys as a dictionary.
        out: The sheet; it ends in .svg, .pdf or .png.
        paper: The name of the paper, such as "a4"; without it, the page is as large as the sheet.
        dpi: The resolution of a PNG.
    """
    keys = json.dumps(target) if isinstance(target, Mapping) else os.fspath(target)
    points, remarks = _heba.write_sheet(keys, Path(out), paper or "", dpi)
    for remark in remarks:
        warnings.warn(remark, stacklevel=2)
    return points
