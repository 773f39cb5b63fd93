"""Checks of arrays that users give."""

from __future__ import annotations

from typing import Any, Sequence

from ._heba import Error
from ._numpy import np

_MOST_SKEW = 1e-3  # A rotation that was written with four digits deviates from an orthonormal matrix by this.


def rotation_matrix(value: Any, name: str) -> np.ndarray:
    """Returns a rotation, 3 x 3, from a matrix or a rotation vector."""
    array = _finite(value, name)
    if array.size == 3:
        return _from_rotation_vector(array.reshape(3))
    if array.shape != (3, 3):
        raise Error(f"{name}: must be a 3 x 3 matrix or a rotation vector; it has the shape {array.shape}")
    _check_rotation(array, name)
    return array


def matrices_of(rotations: Sequence[Any], translations: Sequence[Any], names: tuple[str, str]) -> np.ndarray:
    """Returns n poses, n x 4 x 4, from rotations and translations as OpenCV takes them."""
    if len(rotations) != len(translations):
        raise Error(f"{names[0]} has {len(rotations)} rotations, but {names[1]} has {len(translations)} translations")
    poses = np.zeros((len(rotations), 4, 4))
    poses[:, 3, 3] = 1
    for i, (rotation, translation) in enumerate(zip(rotations, translations)):
        poses[i, :3, :3] = rotation_matrix(rotation, f"{names[0]}[{i}]")
        vector = _finite(translation, f"{names[1]}[{i}]")
        if vector.size != 3:
            raise Error(f"{names[1]}[{i}]: must have 3 numbers; it has the shape {vector.shape}")
        poses[i, :3, 3] = vector.reshape(3)
    return poses


def poses_from(value: Any, name: str) -> np.ndarray:
    """Returns n poses, n x 4 x 4. A single 4 x 4 matrix counts as one pose."""
    array = _finite(value, name)
    if array.ndim == 2:
        array = array[np.newaxis]
    if array.ndim != 3 or array.shape[1:] != (4, 4):
        raise Error(f"{name}: must be n x 4 x 4 matrices; it has the shape {np.shape(value)}")
    for i, pose in enumerate(array):
        if not np.allclose(pose[3], (0, 0, 0, 1)):
            raise Error(f"{name}[{i}]: its last row must be 0, 0, 0, 1")
        _check_rotation(pose[:3, :3], f"{name}[{i}]")
    return array


def joints_from(value: Any, num_poses: int, name: str) -> list[list[float]]:
    """Returns the positions of an arm's joints at n poses."""
    array = _finite(value, name)
    if array.ndim != 2 or len(array) != num_poses:
        raise Error(f"{name}: must be {num_poses} rows of numbers; it has the shape {np.shape(value)}")
    return array.tolist()


def grey_from(value: np.ndarray, name: str) -> np.ndarray:
    """Returns a grey image of 8 bits, without a copy if it is one already. Three channels are blue, green and red."""
    if value.dtype != np.uint8 or value.ndim not in (2, 3) or (value.ndim == 3 and value.shape[2] not in (1, 3)):
        raise Error(
            f"{name}: must be an image of type uint8, height x width or height x width x 3; "
            f"it has the type {value.dtype} and the shape {value.shape}"
        )
    if value.size == 0:
        raise Error(f"{name}: has no pixels")
    if value.ndim == 3 and value.shape[2] == 3:
        weights = np.array([0.114, 0.587, 0.299])
        return np.ascontiguousarray(np.rint(value @ weights).astype(np.uint8))
    return np.ascontiguousarray(value.reshape(value.shape[:2]))


def _finite(value: Any, name: str) -> np.ndarray:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise Error(f"{name}: must be numbers") from None
    if not np.isfinite(array).all():
        raise Error(f"{name}: contains a number that is not finite")
    return array


def _check_rotation(matrix: np.ndarray, name: str) -> None:
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > _MOST_SKEW or np.linalg.det(matrix) < 0:
        raise Error(f"{name}: is no rotation matrix")


def _from_rotation_vector(vector: np.ndarray) -> np.ndarray:
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
