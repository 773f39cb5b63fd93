"""The result of a run."""

from __future__ import annotations

import contextlib
import html
import json
import os
import tempfile
from pathlib import Path
from typing import Any, Iterator, TypeVar

from . import _heba
from ._heba import Error, unknown_name
from ._numpy import needs_numpy, np


Kind = TypeVar("Kind", bound="RunFolder")


def matrix_of(pose: dict[str, Any]) -> np.ndarray:
    """Returns the 4 x 4 matrix of a pose as result.json has it."""
    x, y, z, w = pose["quaternion_xyzw"]
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = pose["translation_m"]
    return matrix


def camera_matrix_of(camera: dict[str, Any]) -> np.ndarray:
    """Returns the 3 x 3 matrix of a camera as result.json has it, px."""
    return np.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])


class RunFolder:
    """The contents of a result.json, whose keys and units the manual lists: what `Result` and `RigResult` share.

    Attributes:
        data: The whole file as Python's dictionaries and lists.
        folder: The folder of the run, with report.html; None for a calibration from arrays.
    """

    _schema: str

    def __init__(self, text: str, folder: Path | None = None) -> None:
        self._text = text
        self.data: dict[str, Any] = json.loads(text)
        self.folder = folder

    @classmethod
    def read(cls: type[Kind], folder: str | os.PathLike[str]) -> Kind:
        """Reads the result of a run from its folder."""
        file = Path(folder) / "result.json"
        try:
            result = cls(file.read_text(encoding="utf-8"), Path(folder))
        except FileNotFoundError:
            raise Error(f"{file}: there is no such file") from None
        except json.JSONDecodeError as error:
            raise Error(f"{file}:{error.lineno}: {error.msg}") from None
        schema = result.data.get("schema")
        if schema != cls._schema:
            raise Error(f"{file}: has the schema {schema!r}, not {cls._schema!r}, which heba.{cls.__name__} reads")
        return result

    @property
    def verdict(self) -> dict[str, Any]:
        """The grade ("good", "doubtful" or "bad") and the findings, each with its code, text and action."""
        return self.data["verdict"]

    @property
    def report_path(self) -> Path | None:
        """The report of the run; None for a calibration from arrays."""
        return None if self.folder is None else self.folder / "report.html"

    def table(self) -> str:
        """Returns the table that `heba run` prints."""
        with self._file() as file:
            return _heba.table(file)

    def export(
        self, format: str, out: str | os.PathLike[str] | None = None, *, force: bool = False
    ) -> dict[str, str]:
        """Returns the files of a format of `heba export`, such as "ros" or "opencv": their names and texts.

        Args:
            format: The name of the format.
            out: A folder in which the files are written, too.
            force: Whether a calibrated arm is exported although the verdict of the run is bad.
        """
        with self._file() as file:
            files = dict(_heba.export(file, format, force))
        if out is not None:
            Path(out).mkdir(parents=True, exist_ok=True)
            for name, text in files.items():
                (Path(out) / name).write_text(text, encoding="utf-8")
        return files

    @contextlib.contextmanager
    def _file(self) -> Iterator[Path]:
        if self.folder is not None:
            yield self.folder / "result.json"
            return
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "result.json"
            file.write_text(self._text, encoding="utf-8")
            yield file

    def _repr_html_(self) -> str:
        """Shows the verdict, the table and the report with the cell in 3-D in a notebook."""
        findings = "".join(
            f"<li>{html.escape(finding['text'])}"
            + (f" <i>{html.escape(finding['action'])}</i>" if finding.get("action") else "")
            for finding in self.verdict["findings"]
            if finding["grade"] != "good"
        )
        parts = [
            f"<p><b>{html.escape(self.data['name'])}: {self.verdict['grade']}</b></p>",
            f"<ul>{findings}</ul>" if findings else "",
            f"<pre>{html.escape(self.table())}</pre>",
        ]
        if self.report_path is not None and self.report_path.exists():
            report = html.escape(self.report_path.read_text(encoding="utf-8"))
            parts.append(f'<iframe srcdoc="{report}" style="width:100%;height:640px;border:0"></iframe>')
        return "".join(parts)

    def __repr__(self) -> str:
        return f"<heba.{type(self).__name__} {self.data['name']!r}: {self.verdict['grade']}>"


class Result(RunFolder):
    """The result of a run with one camera and one target."""

    _schema = "heba/result/1"

    def estimate(self, method: str | None = None) -> dict[str, Any]:
        """Returns the refined estimate, or the one of a method, as in result.json.

        Without images or points, the refined estimate is that of the poses, "chain".
        """
        usable = {entry["method"]: entry for entry in self.data["estimates"] if entry["ok"]}
        for name in ("bundle", "chain") if method is None else (method,):
            if name in usable:
                return usable[name]
        if method is None:
            raise Error(f"the result has no refined estimate; it has: {', '.join(usable)}")
        raise Error(f"method: {unknown_name(method, list(usable))}")

    @property
    @needs_numpy
    def hand_eye(self) -> np.ndarray:
        """The camera's pose, 4 x 4, m: base_from_camera or gripper_from_camera."""
        return matrix_of(self.estimate()["hand_eye"])

    @property
    @needs_numpy
    def sigma(self) -> np.ndarray | None:
        """One sigma of hand_eye: along x, y and z of the camera (m), then about them (rad)."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance))

    @property
    def camera_model(self) -> str:
        """The name of the camera model."""
        return self.estimate()["camera"]["model"]

    @property
    @needs_numpy
    def camera_matrix(self) -> np.ndarray:
        """The focal lengths and the principal point as OpenCV's 3 x 3 camera matrix, px."""
        return camera_matrix_of(self.estimate()["camera"])

    @property
    @needs_numpy
    def distortion(self) -> np.ndarray:
        """The further parameters of the camera model; those of brown5 are OpenCV's k1, k2, p1, p2, k3."""
        return np.array(self.estimate()["camera"]["distortion"])

    @property
    @needs_numpy
    def board(self) -> np.ndarray:
        """The target's pose, 4 x 4, m: gripper_from_target or base_from_target."""
        return matrix_of(self.estimate()["board"])

    @property
    @needs_numpy
    def covariance(self) -> np.ndarray | None:
        """The covariance of hand_eye, 6 x 6: translation (m), then rotation (rad), in the camera's frame."""
        return self._covariance_of_hand_eye("covariance")

    @property
    @needs_numpy
    def covariance_repeatable(self) -> np.ndarray | None:
        """The covariance without what all sessions of a cell have in common: the scales of its robot and target."""
        return self._covariance_of_hand_eye("covariance_repeatable")

    def _covariance_of_hand_eye(self, key: str) -> np.ndarray | None:
        covariance = self.estimate().get(key)
        return None if covariance is None else np.array(covariance["matrix"])[:6, :6]
