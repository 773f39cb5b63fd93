"""The result of a run."""

from __future__ import annotations

import contextlib
import html
import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator

from . import _heba
from ._arrays import joints_from, poses_from
from ._heba import Error, unknown_name
from ._numpy import needs_numpy, np
from ._plots import plot_images

_SCHEMAS = ("heba/result/1", "heba/rig/1")
# What stands for the names of the parts of a run that has one camera, one target and one arm without names.
_CAMERA, _TARGET, _ARM = "camera", "target", "robot"


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


@dataclass(frozen=True)
class CameraResult:
    """A calibrated camera.

    Attributes:
        mount: What carries it: "world", "gripper", "ARM.base", ...; "base" or "gripper" if the parts have no names.
        pose: mount_from_camera, 4 x 4, m.
        covariance: The covariance of the pose, 6 x 6: translation (m), then rotation (rad), in the camera's frame;
            None if it is not known.
        camera: The model and its parameters as in result.json; None in a run on poses of the target.
    """

    mount: str
    pose: np.ndarray
    covariance: np.ndarray | None
    camera: dict[str, Any] | None

    @property
    def sigma(self) -> np.ndarray | None:
        """One sigma of the pose: along x, y and z of the camera (m), then about them (rad)."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance))

    @property
    def camera_model(self) -> str:
        """The name of the camera model."""
        if self.camera is None:
            raise Error("a run on poses of the target has no camera model")
        return self.camera["model"]

    @property
    def camera_matrix(self) -> np.ndarray:
        """The focal lengths and the principal point as OpenCV's 3 x 3 camera matrix, px."""
        return camera_matrix_of(self.camera)

    @property
    def distortion(self) -> np.ndarray:
        """The further parameters of the camera model; those of brown5 are OpenCV's k1, k2, p1, p2, k3."""
        return np.array(self.camera["distortion"])


@dataclass(frozen=True)
class TargetResult:
    """A target of a run.

    Attributes:
        mount: As of CameraResult.
        pose: mount_from_target, 4 x 4, m.
        covariance: The covariance of the pose, 6 x 6: translation (m), then rotation (rad), in the target's frame.
        shape: Its difference from the design as in result.json; None if it is as designed.
    """

    mount: str
    pose: np.ndarray
    covariance: np.ndarray | None
    shape: dict[str, Any] | None


@dataclass(frozen=True)
class ArmResult:
    """An arm of a run.

    Attributes:
        pose: world_from_base, 4 x 4, m. The world is the base of the first arm.
        covariance: The covariance of the pose, 6 x 6: translation (m), then rotation (rad), in the frame of the base;
            None for the first arm.
        noise: The noise of its poses as in result.json; None if there is none.
        kinematics: Its kinematics and their estimated errors, `robot` of result.json; None if the config names no
            model of the arm.
    """

    pose: np.ndarray
    covariance: np.ndarray | None
    noise: dict[str, Any] | None
    kinematics: dict[str, Any] | None


@dataclass(frozen=True)
class RelativePose:
    """The pose of one camera in another.

    Attributes:
        pose: parent_from_child, 4 x 4, m.
        covariance: The covariance of the pose, 6 x 6: translation (m), then rotation (rad), in the child's frame.
    """

    pose: np.ndarray
    covariance: np.ndarray


class Result:
    """The result of a run with any number of cameras, targets and arms: a result.json, whose keys and units the manual lists.

    A run whose parts have no names has one of each, which are called "camera", "target" and "robot" here. The pose of
    the only camera is `hand_eye`.

    >>> result = heba.run("cell.yaml")
    >>> print(result.cameras["left"].pose, result.relative("left", "right").covariance)

    Attributes:
        data: The whole file as Python's dictionaries and lists.
        folder: The folder of the run, with report.html; None for a calibration from arrays.
    """

    def __init__(self, text: str, folder: Path | None = None) -> None:
        self._text = text
        self.data: dict[str, Any] = json.loads(text)
        self.folder = folder

    @classmethod
    def read(cls, folder: str | os.PathLike[str]) -> Result:
        """Reads the result of a run from its folder."""
        file = Path(folder) / "result.json"
        try:
            result = cls(file.read_text(encoding="utf-8"), Path(folder))
        except FileNotFoundError:
            raise Error(f"{file}: there is no such file") from None
        except json.JSONDecodeError as error:
            raise Error(f"{file}:{error.lineno}: {error.msg}") from None
        schema = result.data.get("schema")
        if schema not in _SCHEMAS:
            raise Error(f"{file}: has the schema {schema!r}, not {' or '.join(map(repr, _SCHEMAS))}")
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

    @needs_numpy
    def correct(
        self, poses: Any, joints: Any = None, *, arm: str = "", inverse: bool = False, force: bool = False
    ) -> np.ndarray:
        """Corrects poses by the estimated errors of an arm, as `heba correct` does, and returns n x 4 x 4 matrices.

        Args:
            poses: base_from_gripper as the controller reports it, n x 4 x 4, m.
            joints: The positions of the joints at the poses, n x joints, rad or m; they are needed if the captures are
                in several configurations. With `inverse`, positions near them.
            arm: The name of the arm; the only one needs none.
            inverse: Whether `poses` are where the gripper shall truly be; the poses to command are returned.
            force: Whether poses are corrected although the verdict of the run is bad.
        """
        given = poses_from(poses, "poses")
        at = [] if joints is None else joints_from(joints, len(given), "joints")
        with self._file() as file:
            return np.array(_heba.correct(file, arm, given, at, inverse, force))

    @needs_numpy
    def plot(self, axes: Any = None) -> Any:
        """Draws how far each image is from the prediction of the others (mm), and returns matplotlib's axes."""
        return plot_images(self, axes)

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
        return f"<heba.Result {self.data['name']!r}: {self.verdict['grade']}>"

    def estimate(self, method: str | None = None) -> dict[str, Any]:
        """Returns the refined estimate, or the one of a method, as in result.json.

        Without images or points, the refined estimate is that of the poses, "chain".
        """
        if not self._is_short:
            raise Error("the parts of the run have names, and it has one estimate: Result.cameras, targets and robots")
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
        """The only camera's pose, 4 x 4, m: base_from_camera or gripper_from_camera."""
        return self._only_camera.pose

    @property
    @needs_numpy
    def sigma(self) -> np.ndarray | None:
        """One sigma of hand_eye: along x, y and z of the camera (m), then about them (rad)."""
        return self._only_camera.sigma

    @property
    @needs_numpy
    def camera_model(self) -> str:
        """The name of the only camera's model."""
        return self._only_camera.camera_model

    @property
    @needs_numpy
    def camera_matrix(self) -> np.ndarray:
        """The focal lengths and the principal point as OpenCV's 3 x 3 camera matrix, px."""
        return self._only_camera.camera_matrix

    @property
    @needs_numpy
    def distortion(self) -> np.ndarray:
        """The further parameters of the camera model; those of brown5 are OpenCV's k1, k2, p1, p2, k3."""
        return self._only_camera.distortion

    @property
    @needs_numpy
    def board(self) -> np.ndarray:
        """The only target's pose, 4 x 4, m: gripper_from_target or base_from_target."""
        targets = self.targets
        if len(targets) != 1:
            raise Error("the run has several targets: their poses are in Result.targets")
        return next(iter(targets.values())).pose

    @property
    @needs_numpy
    def covariance(self) -> np.ndarray | None:
        """The covariance of hand_eye, 6 x 6: translation (m), then rotation (rad), in the camera's frame."""
        return self._only_camera.covariance

    @property
    @needs_numpy
    def covariance_repeatable(self) -> np.ndarray | None:
        """The covariance without what all sessions of a cell have in common: the scales of its robot and target."""
        return self._covariance_of(self._pose_of_only_camera, "covariance_repeatable")

    @property
    @needs_numpy
    def cameras(self) -> dict[str, CameraResult]:
        """The cameras by their names."""
        if self._is_short:
            estimate = self.estimate()
            mount = estimate["hand_eye"]["parent"]
            pose = matrix_of(estimate["hand_eye"])
            return {_CAMERA: CameraResult(mount, pose, self._covariance_of("hand_eye"), estimate["camera"])}
        return {
            name: CameraResult(
                camera["mount"],
                matrix_of(camera["pose"]),
                self._covariance_of(f"cameras.{name}.pose"),
                camera["camera"],
            )
            for name, camera in self.data["cameras"].items()
        }

    @property
    @needs_numpy
    def targets(self) -> dict[str, TargetResult]:
        """The targets by their names."""
        if self._is_short:
            estimate = self.estimate()
            shape = estimate.get("target_shape")
            board = estimate["board"]
            return {_TARGET: TargetResult(board["parent"], matrix_of(board), self._covariance_of("board"), shape)}
        return {
            name: TargetResult(
                target["mount"],
                matrix_of(target["pose"]),
                self._covariance_of(f"targets.{name}.pose"),
                target["shape"],
            )
            for name, target in self.data["targets"].items()
        }

    @property
    @needs_numpy
    def robots(self) -> dict[str, ArmResult]:
        """The arms by their names, the first of which has the world as its base."""
        if self._is_short:
            estimate = self.estimate()
            return {_ARM: ArmResult(np.eye(4), None, _noise_of(estimate), estimate.get("robot"))}
        arms = {}
        for name, arm in self.data["robots"].items():
            covariance = self._covariance_of(f"robots.{name}.world_from_base") if arms else None
            arms[name] = ArmResult(matrix_of(arm["world_from_base"]), covariance, arm["noise"], arm.get("robot"))
        return arms

    @needs_numpy
    def relative(self, parent: str, child: str) -> RelativePose:
        """Returns the pose of the camera `child` in the camera `parent`.

        Its covariance is smaller than those of the two poses, which are correlated. Either order of the names is known
        if both cameras stand still against each other: in the cell, or on one gripper.

        Raises:
            heba.Error: There is no such camera, or an arm moves one against the other.
        """
        for name in (parent, child):
            if name not in self.cameras:
                raise Error(f"camera: {unknown_name(name, list(self.cameras))}")
        for pose in self.data.get("relative", []):
            ends = (pose["parent"], pose["child"])
            if ends == (parent, child):
                return RelativePose(matrix_of(pose), np.array(pose["covariance"]))
            if ends == (child, parent):
                child_from_parent = matrix_of(pose)
                adjoint = _adjoint(child_from_parent)
                covariance = adjoint @ np.array(pose["covariance"]) @ adjoint.T
                return RelativePose(np.linalg.inv(child_from_parent), covariance)
        raise Error(f"cameras {parent} and {child}: have no constant pose in each other")

    @property
    def _is_short(self) -> bool:
        return self.data["schema"] == _SCHEMAS[0]

    @property
    def _only_camera(self) -> CameraResult:
        cameras = self.cameras
        if len(cameras) != 1:
            raise Error("the run has several cameras: their poses are in Result.cameras")
        return next(iter(cameras.values()))

    @property
    def _pose_of_only_camera(self) -> str:
        return "hand_eye" if self._is_short else f"cameras.{next(iter(self.cameras))}.pose"

    def _covariance_of(self, block: str, key: str = "covariance") -> np.ndarray | None:
        covariance = (self.estimate() if self._is_short else self.data).get(key)
        if covariance is None or f"{block}.tx_m" not in covariance["order"]:
            return None
        first = covariance["order"].index(f"{block}.tx_m")
        return np.array([row[first : first + 6] for row in covariance["matrix"][first : first + 6]])


def _noise_of(estimate: dict[str, Any]) -> dict[str, Any] | None:
    """Returns the noise of the only arm in the form of those with names."""
    solve = estimate.get("solve") or {}
    if solve.get("robot_sigma_mm") is None:
        return None
    keys = {"mm": "robot_sigma_mm", "deg": "robot_sigma_deg", "joint_deg": "joint_sigma_deg"}
    return {**{name: solve.get(key) for name, key in keys.items()}, "std_mm": None, "std_deg": None}


def _adjoint(pose: np.ndarray) -> np.ndarray:
    """Returns the matrix that moves a tangent (translation, then rotation) through a pose: pose Exp(x) = Exp(Ad x) pose."""
    x, y, z = pose[:3, 3]
    adjoint = np.zeros((6, 6))
    adjoint[:3, :3] = adjoint[3:, 3:] = pose[:3, :3]
    adjoint[:3, 3:] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ pose[:3, :3]
    return adjoint
