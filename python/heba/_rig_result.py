"""The result of a run with a rig."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ._heba import Error, unknown_name
from ._numpy import needs_numpy, np
from ._result import RunFolder, camera_matrix_of, matrix_of


@dataclass(frozen=True)
class RigCamera:
    """A camera of a rig.

    Attributes:
        mount: What carries it: "world", "gripper", "ARM.base", ...
        pose: mount_from_camera, 4 x 4, m.
        covariance: The covariance of the pose, 6 x 6: translation (m), then rotation (rad), in the camera's frame.
        camera: The model and its parameters as in result.json.
    """

    mount: str
    pose: np.ndarray
    covariance: np.ndarray
    camera: dict[str, Any]

    @property
    def sigma(self) -> np.ndarray:
        """One sigma of the pose: along x, y and z of the camera (m), then about them (rad)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def camera_model(self) -> str:
        """The name of the camera model."""
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
class RigTarget:
    """A target of a rig.

    Attributes:
        mount: As of RigCamera.
        pose: mount_from_target, 4 x 4, m.
        covariance: The covariance of the pose, 6 x 6: translation (m), then rotation (rad), in the target's frame.
        shape: Its difference from the design as in result.json; None if it is as designed.
    """

    mount: str
    pose: np.ndarray
    covariance: np.ndarray
    shape: dict[str, Any] | None


@dataclass(frozen=True)
class RigArm:
    """An arm of a rig.

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


class RigResult(RunFolder):
    """The result of a run with a rig: several cameras, targets and arms, by their names.

    >>> result = heba.run("cell.yaml")
    >>> print(result.cameras["left"].pose, result.relative("left", "right").covariance)
    """

    _schema = "heba/rig/1"

    @property
    @needs_numpy
    def cameras(self) -> dict[str, RigCamera]:
        """The cameras by their names."""
        return {
            name: RigCamera(
                camera["mount"],
                matrix_of(camera["pose"]),
                self._covariance_of(f"cameras.{name}.pose"),
                camera["camera"],
            )
            for name, camera in self.data["cameras"].items()
        }

    @property
    @needs_numpy
    def targets(self) -> dict[str, RigTarget]:
        """The targets by their names."""
        return {
            name: RigTarget(
                target["mount"],
                matrix_of(target["pose"]),
                self._covariance_of(f"targets.{name}.pose"),
                target["shape"],
            )
            for name, target in self.data["targets"].items()
        }

    @property
    @needs_numpy
    def robots(self) -> dict[str, RigArm]:
        """The arms by their names, the first of which has the world as its base."""
        arms = {}
        for name, arm in self.data["robots"].items():
            covariance = self._covariance_of(f"robots.{name}.world_from_base") if arms else None
            arms[name] = RigArm(matrix_of(arm["world_from_base"]), covariance, arm["noise"], arm.get("robot"))
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
            if name not in self.data["cameras"]:
                raise Error(f"camera: {unknown_name(name, list(self.data['cameras']))}")
        for pose in self.data["relative"]:
            ends = (pose["parent"], pose["child"])
            if ends == (parent, child):
                return RelativePose(matrix_of(pose), np.array(pose["covariance"]))
            if ends == (child, parent):
                child_from_parent = matrix_of(pose)
                adjoint = _adjoint(child_from_parent)
                covariance = adjoint @ np.array(pose["covariance"]) @ adjoint.T
                return RelativePose(np.linalg.inv(child_from_parent), covariance)
        raise Error(f"cameras {parent} and {child}: have no constant pose in each other")

    def _covariance_of(self, block: str) -> np.ndarray:
        covariance = self.data["covariance"]
        first = covariance["order"].index(f"{block}.tx_m")
        rows = covariance["matrix"][first : first + 6]
        return np.array([row[first : first + 6] for row in rows])


def _adjoint(pose: np.ndarray) -> np.ndarray:
    """Returns the matrix that moves a tangent (translation, then rotation) through a pose: pose Exp(x) = Exp(Ad x) pose."""
    x, y, z = pose[:3, 3]
    adjoint = np.zeros((6, 6))
    adjoint[:3, :3] = adjoint[3:, 3:] = pose[:3, :3]
    adjoint[:3, 3:] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ pose[:3, :3]
    return adjoint
