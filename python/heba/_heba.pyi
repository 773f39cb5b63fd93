"""The compiled part of heba, whose arguments the package checks."""

from pathlib import Path
from typing import Callable, Sequence

import numpy as np

__version__: str

class Error(ValueError): ...

class Cancellation:
    def request(self) -> None: ...

def unknown_name(unknown: str, known: Sequence[str]) -> str: ...
def solve_pairs(
    setup: str, base_from_gripper: np.ndarray, camera_from_target: np.ndarray, method: str
) -> tuple[np.ndarray, np.ndarray]: ...
def closed_forms() -> list[tuple[str, str]]: ...
def target_ids(target: str) -> list[int]: ...
def detect_array(grey: np.ndarray, target: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]: ...
def detect_file(image: str | Path, target: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]: ...
def has_names(folder: str | Path) -> bool: ...
def locate(
    folder: str | Path,
    images: Sequence[tuple[str, np.ndarray | None, str | Path]],
    base_from_gripper: Sequence[tuple[str, np.ndarray]],
    joints: Sequence[tuple[str, Sequence[float]]],
) -> list[tuple[str, list[str], np.ndarray, np.ndarray, float, int, float, np.ndarray]]: ...
def calibrate(
    setup: str,
    target: str,
    cameras: Sequence[
        tuple[
            str,
            Sequence[tuple[list[int], np.ndarray] | None],
            tuple[int, int],
            tuple[str, list[float]] | None,
        ]
    ],
    base_from_gripper: np.ndarray,
    num_folds: int,
    num_threads: int,
    progress: Callable[[str, int, int], object] | None,
    cancellation: Cancellation,
) -> str: ...
def run(
    config: str | Path,
    settings: Sequence[str],
    out: str | Path | None,
    num_threads: int,
    progress: Callable[[str, int, int], object] | None,
    cancellation: Cancellation,
) -> Path: ...
def diagnose(
    config: str | Path, settings: Sequence[str], num_threads: int
) -> list[tuple[str, bool, str, str, list[str]]]: ...
def export(result_file: str | Path, format: str, force: bool) -> list[tuple[str, str]]: ...
def table(result_file: str | Path) -> str: ...
def compare(runs: Sequence[str | Path], out: str | Path | None) -> tuple[str, str, str]: ...
def correct(
    result_file: str | Path,
    arm: str,
    base_from_gripper: np.ndarray,
    joints: Sequence[Sequence[float]],
    is_inverse: bool,
    is_forced: bool,
) -> list[np.ndarray]: ...
def write_sheet(target: str, out: str | Path, paper: str, dpi: float) -> tuple[Path, list[str]]: ...
def init(
    folder: str | Path,
    out: str | Path,
    images: str,
    poses: str,
    camera: str,
    target: str,
    setup: str,
    is_forced: bool,
    num_threads: int,
) -> tuple[Path, list[str], list[str]]: ...
def study(
    config: str | Path, out: str | Path | None, num_threads: int, cancellation: Cancellation
) -> tuple[str, str]: ...
def simulate(scene: str | Path, settings: Sequence[str], out: str | Path, num_threads: int) -> Path: ...
def plan(
    cell: str | Path, settings: Sequence[str], count: int, is_two_step: bool
) -> tuple[list[tuple[str, np.ndarray, list[float], float, float, float, float]], str]: ...
def check(
    folder: str | Path,
    images: Sequence[tuple[str, Path]],
    arms: Sequence[tuple[str, np.ndarray | None, str, list[list[float]], str]],
    is_target_in_place: bool,
    reference: Path | None,
    num_threads: int,
) -> tuple[str, list[str]]: ...
