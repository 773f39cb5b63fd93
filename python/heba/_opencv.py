"""Hand-eye calibration with the arguments of OpenCV's functions.

`calibrateHandEye` and `calibrateRobotWorldHandEye` have OpenCV's names and arguments, so that
`from heba import calibrateHandEye` changes a script; `calibrate_hand_eye` and `calibrate_robot_world_hand_eye` are the
same functions under names that Python programmers expect.
"""

from __future__ import annotations

import warnings
from typing import Any, Sequence

from . import _heba
from ._arrays import matrices_of
from ._heba import Error, unknown_name
from ._numpy import needs_numpy, np

CALIB_HAND_EYE_TSAI = 0
CALIB_HAND_EYE_PARK = 1
CALIB_HAND_EYE_HORAUD = 2
CALIB_HAND_EYE_ANDREFF = 3
CALIB_HAND_EYE_DANIILIDIS = 4
CALIB_ROBOT_WORLD_HAND_EYE_SHAH = 0
CALIB_ROBOT_WORLD_HAND_EYE_LI = 1

_HAND_EYE = ("tsai", "park", "horaud", "andreff", "daniilidis")
_ROBOT_WORLD = ("shah", "li")


def methods() -> dict[str, str]:
    """Returns the names of all methods with their descriptions, for the argument `method`."""
    best = "refinement that weighs the errors of the robot's poses against those of the target's, from the best closed form"
    return {"best": best, **dict(_heba.closed_forms())}


@needs_numpy
def calibrate_hand_eye(
    R_gripper2base: Sequence[Any],
    t_gripper2base: Sequence[Any],
    R_target2cam: Sequence[Any],
    t_target2cam: Sequence[Any],
    method: str | int = "best",
) -> tuple[np.ndarray, np.ndarray]:
    """Finds the pose of a camera on the gripper, as cv2.calibrateHandEye does.

    For a camera beside the robot, give the poses of the base in the gripper in place of those of the gripper in the
    base; the result is then the pose of the camera in the base.

    Args:
        R_gripper2base: n rotations, 3 x 3 matrices or rotation vectors: the gripper's in the base.
        t_gripper2base: n translations, in any unit.
        R_target2cam: n rotations: the target's in the camera.
        t_target2cam: n translations, in the same unit.
        method: "best", one of heba.methods(), or a number CALIB_HAND_EYE_... of OpenCV.

    Returns:
        R_cam2gripper (3 x 3) and t_cam2gripper (3 x 1).

    Raises:
        heba.Error: The arguments are wrong, or the poses do not determine the result. OpenCV returns NaN or a wrong
            pose then.
    """
    camera, _ = _solve(
        matrices_of(R_gripper2base, t_gripper2base, ("R_gripper2base", "t_gripper2base")),
        matrices_of(R_target2cam, t_target2cam, ("R_target2cam", "t_target2cam")),
        _method(method, _HAND_EYE, "CALIB_HAND_EYE"),
    )
    return _parts(camera)


@needs_numpy
def calibrate_robot_world_hand_eye(
    R_world2cam: Sequence[Any],
    t_world2cam: Sequence[Any],
    R_base2gripper: Sequence[Any],
    t_base2gripper: Sequence[Any],
    method: str | int = "best",
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Finds the poses of the camera and of the target (the world), as cv2.calibrateRobotWorldHandEye does.

    Args:
        R_world2cam: n rotations, 3 x 3 matrices or rotation vectors: the target's in the camera.
        t_world2cam: n translations, in any unit.
        R_base2gripper: n rotations: the base's in the gripper.
        t_base2gripper: n translations, in the same unit.
        method: "best", one of heba.methods(), or a number CALIB_ROBOT_WORLD_HAND_EYE_... of OpenCV.

    Returns:
        R_base2world, t_base2world, R_gripper2cam and t_gripper2cam.

    Raises:
        heba.Error: As calibrate_hand_eye.
    """
    base2gripper = matrices_of(R_base2gripper, t_base2gripper, ("R_base2gripper", "t_base2gripper"))
    camera, target = _solve(
        np.linalg.inv(base2gripper),
        matrices_of(R_world2cam, t_world2cam, ("R_world2cam", "t_world2cam")),
        _method(method, _ROBOT_WORLD, "CALIB_ROBOT_WORLD_HAND_EYE"),
    )
    return *_parts(np.linalg.inv(target)), *_parts(np.linalg.inv(camera))


@needs_numpy
def calibrateHandEye(  # noqa: N802: OpenCV's name.
    R_gripper2base: Sequence[Any],
    t_gripper2base: Sequence[Any],
    R_target2cam: Sequence[Any],
    t_target2cam: Sequence[Any],
    R_cam2gripper: np.ndarray | None = None,
    t_cam2gripper: np.ndarray | None = None,
    method: str | int = "best",
) -> tuple[np.ndarray, np.ndarray]:
    """calibrate_hand_eye with OpenCV's name and its arguments for the output, which are filled if they are arrays."""
    results = calibrate_hand_eye(R_gripper2base, t_gripper2base, R_target2cam, t_target2cam, method)
    _fill((R_cam2gripper, t_cam2gripper), results)
    return results


@needs_numpy
def calibrateRobotWorldHandEye(  # noqa: N802: OpenCV's name.
    R_world2cam: Sequence[Any],
    t_world2cam: Sequence[Any],
    R_base2gripper: Sequence[Any],
    t_base2gripper: Sequence[Any],
    R_base2world: np.ndarray | None = None,
    t_base2world: np.ndarray | None = None,
    R_gripper2cam: np.ndarray | None = None,
    t_gripper2cam: np.ndarray | None = None,
    method: str | int = "best",
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """calibrate_robot_world_hand_eye with OpenCV's name and its arguments for the output."""
    results = calibrate_robot_world_hand_eye(R_world2cam, t_world2cam, R_base2gripper, t_base2gripper, method)
    _fill((R_base2world, t_base2world, R_gripper2cam, t_gripper2cam), results)
    return results


def _warn_of_units(robot: np.ndarray, target: np.ndarray) -> None:
    """Warns if the robot's poses and the target's are in different units: their motions differ by more than 100 times."""
    if len(robot) < 2:
        return
    steps = [np.median(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)) for poses in (robot, target)]
    most = 100
    if min(steps) > 0 and max(steps) > most * min(steps):
        larger, smaller = ("robot", "target") if steps[0] > steps[1] else ("target", "robot")
        warnings.warn(
            f"the {larger} moves {max(steps) / min(steps):.0f} times as far between the poses as the {smaller}: "
            "are the translations of one in mm and those of the other in m?",
            stacklevel=4,
        )


def _parts(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return pose[:3, :3].copy(), pose[:3, 3:].copy()


def _fill(outputs: Sequence[np.ndarray | None], results: Sequence[np.ndarray]) -> None:
    for output, result in zip(outputs, results):
        if output is not None:
            output[...] = result.reshape(output.shape)


def _method(method: str | int, of_opencv: Sequence[str], constant: str) -> str:
    if isinstance(method, str):
        if method in methods():
            return method
        raise Error(f"method: {unknown_name(method, list(methods()))}")
    if not 0 <= int(method) < len(of_opencv):
        raise Error(f"method: {method} is not one of OpenCV's constants {constant}_...")
    return of_opencv[int(method)]


def _solve(base_from_gripper: np.ndarray, camera_from_target: np.ndarray, method: str) -> tuple[np.ndarray, np.ndarray]:
    if len(base_from_gripper) != len(camera_from_target):
        raise Error(
            f"there are {len(base_from_gripper)} poses of the robot, but {len(camera_from_target)} of the target"
        )
    _warn_of_units(base_from_gripper, camera_from_target)
    # The methods count in metres; poses in millimetres would be a cell of a kilometre.
    unit = _unit(base_from_gripper, camera_from_target)
    base_from_gripper, camera_from_target = base_from_gripper.copy(), camera_from_target.copy()
    base_from_gripper[:, :3, 3] *= unit
    camera_from_target[:, :3, 3] *= unit
    poses = _heba.solve_pairs("eye_in_hand", base_from_gripper, camera_from_target, method)
    for pose in poses:
        pose[:3, 3] /= unit
    return poses


def _unit(base_from_gripper: np.ndarray, camera_from_target: np.ndarray) -> float:
    """Returns the length of the poses' unit, m: metres, or millimetres if the target would be farther than 20 m."""
    distances = np.linalg.norm(camera_from_target[:, :3, 3], axis=1)
    return 1e-3 if len(distances) > 0 and np.median(distances) > 20 else 1.0
