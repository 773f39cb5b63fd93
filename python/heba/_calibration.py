"""Runs, calibration from arrays, detection, location and the doctor."""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass
from typing import Any, Callable, Mapping, Sequence, Union

from . import _heba
from ._arguments import Settings, config_file, entries_of, folder_of, interruptible, threads_of
from ._arrays import grey_from, poses_from
from ._heba import Error, unknown_name
from ._numpy import needs_numpy, np
from ._result import Result

Image = Union["np.ndarray", str, "os.PathLike[str]"]
Progress = Callable[[str, int, int], object]


@dataclass(frozen=True)
class Detection:
    """The points of a target in one image: ids (n), pixels (n x 2), and positions on the target (n x 3, m)."""

    ids: np.ndarray
    pixels: np.ndarray
    points: np.ndarray
    reason: str  # Explains why points are missing; may be empty.

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True)
class Location:
    """A located target.

    Attributes:
        base_from_target: The target's pose in the robot's base, 4 x 4, m; of several arms, in that of the first one.
        covariance: The covariance of the position of its points, 3 x 3, m^2, along the axes of the base.
        rms_px: The RMS of the points of all cameras.
        target: Its name; empty for the only one without a name.
        cameras: The names of the cameras that see it, likewise.
        pose_covariance: The covariance of the pose, 6 x 6: translation (m), then rotation (rad), in the target's frame.
        num_symmetries: The number of orientations in which the target looks the same. It has a location for each.
        chance: The probability that images of cameras that agree differ by as much as these; 1 for one camera.
    """

    base_from_target: np.ndarray
    covariance: np.ndarray
    rms_px: float
    target: str
    cameras: tuple[str, ...]
    pose_covariance: np.ndarray
    num_symmetries: int
    chance: float


@dataclass(frozen=True)
class Symptom:
    """A finding of the doctor. `code` is the same in every version; `cure` may be empty.

    `settings` are those of the config that the cure changes, as `run` and `doctor` take them: "KEY=VALUE".
    """

    code: str
    is_wrong: bool
    what: str
    cure: str
    settings: tuple[str, ...] = ()


def run(
    config: str | os.PathLike[str] | Mapping[str, Any],
    *,
    settings: Settings = (),
    out: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Result:
    """Runs the calibration of a config, as `heba run` does, and writes the same folder.

    Args:
        config: The path of a config, or its contents as a dictionary; paths in it are then relative to the current
            folder.
        settings: What takes precedence over the config, as `--set`: a dictionary, {"refine": {"loss": "none"}} or
            {"refine.loss": "none"}, or entries "KEY=VALUE".
        out: The folder of the results; that of the config by default.
        threads: The number of threads; that of the machine by default. The result does not depend on it.
        progress: Is called with the stage ("detection", "second detection", "hold-out"), the steps that are done and
            their number. An exception that it raises ends the run.

    Raises:
        heba.Error: The input is wrong, or the result cannot be trusted.
    """
    with config_file(config) as file:
        entries, num_threads = entries_of(settings), threads_of(threads)
        folder = interruptible(lambda cancellation: _heba.run(file, entries, out, num_threads, progress, cancellation))
    return Result.read(folder)


def doctor(
    config: str | os.PathLike[str] | Mapping[str, Any], *, settings: Settings = (), threads: int | None = None
) -> list[Symptom]:
    """Examines a data set, as `heba doctor` does. Faults come first; an empty list means that nothing was found."""
    with config_file(config) as file:
        symptoms = _heba.diagnose(file, entries_of(settings), threads_of(threads))
    return [Symptom(*words, tuple(changes)) for *words, changes in symptoms]


@needs_numpy
def detect(image: np.ndarray | str | os.PathLike[str], target: Mapping[str, Any] | str) -> Detection:
    """Detects a target in an image.

    Args:
        image: A grey image (uint8, height x width), one of three channels as OpenCV reads it, or the path of a file.
        target: The target as in a config: a dictionary, or its text as YAML.
    """
    yaml = _target_text(target)
    if isinstance(image, np.ndarray):
        return Detection(*_heba.detect_array(grey_from(image, "image"), yaml))
    return Detection(*_heba.detect_file(image, yaml))


@needs_numpy
def locate(
    run_folder: str | os.PathLike[str] | Result,
    image: Image | Mapping[str, Image],
    *,
    pose: Any = None,
    joints: Sequence[float] | Mapping[str, Sequence[float]] = (),
) -> list[Location]:
    """Locates the targets of a run in the base of its first arm, with their uncertainty.

    Args:
        run_folder: The folder of a run, or its result.
        image: As in detect. For a rig: the images of its cameras, recorded at once, by the names of the cameras.
        pose: For a camera on the robot: base_from_gripper of the image, 4 x 4, as the robot states it. For a rig with
            several arms: a dictionary of these poses by the names of the arms that carry one of the cameras.
        joints: The positions of the arm's joints at that pose (rad or m), if the run has estimated the errors of an arm
            whose configuration the pose does not tell. For a rig with several arms: a dictionary by their names.

    Returns:
        The pose; several for a target that looks the same after a rotation. The first has its x axis most along that
        of the base. For a rig: the targets that the images show, each located by all cameras that see it; several
        locations of a target that looks the same after a rotation, the first with its x axis most along that of the
        world.

    Raises:
        heba.Error: The input is wrong, no target is located, or the images of a target contradict each other.
    """
    folder = folder_of(run_folder, "locate")
    has_names = _heba.has_names(folder)
    if has_names and not (isinstance(image, Mapping) and image):
        raise Error("image: the run is that of a rig; a dictionary of images by the names of its cameras is needed")
    if not has_names and isinstance(image, Mapping):
        raise Error("image: the run has one camera; one image is needed, no dictionary")
    if not has_names and isinstance(joints, Mapping):
        raise Error("joints: the run has one arm; its joints are needed, no dictionary")
    if not has_names and isinstance(pose, Mapping):
        raise Error("pose: the run has one arm; its pose is needed, no dictionary")
    # A single camera and its arm have no names.
    images = image if isinstance(image, Mapping) else {"": image}
    positions = joints if isinstance(joints, Mapping) else {"": joints} if len(joints) > 0 else {}
    poses = pose if isinstance(pose, Mapping) else {} if pose is None else {"": pose}
    found = _heba.locate(
        folder,
        [(name, *_image(one, f"image of camera {name}" if has_names else "image")) for name, one in images.items()],
        [(name, _one_pose(one, f"pose {name}".rstrip())) for name, one in poses.items()],
        [(name, list(one)) for name, one in positions.items()],
    )
    return [
        Location(pose, covariance, rms_px, target, tuple(cameras), pose_covariance, num_symmetries, chance)
        for target, cameras, pose, pose_covariance, rms_px, num_symmetries, chance, covariance in found
    ]


def _one_pose(value: Any, name: str) -> np.ndarray:
    poses = poses_from(value, name)
    if len(poses) != 1:
        raise Error(f"{name}: must be one 4 x 4 matrix")
    return poses


def _image(image: Image, name: str) -> tuple[np.ndarray | None, str | os.PathLike[str]]:
    """Returns a grey image, or the path of a file."""
    return (grey_from(image, name), "") if isinstance(image, np.ndarray) else (None, image)


Lens = tuple[str, Sequence[float]]
Size = tuple[int, int]


@needs_numpy
def calibrate(
    points: Sequence[Any] | Mapping[str, Sequence[Any]],
    poses: Any,
    target: Mapping[str, Any] | str,
    *,
    setup: str,
    image_size: Size | Mapping[str, Size],
    camera: Lens | Mapping[str, Lens | None] | None = None,
    folds: int = 5,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Result:
    """Calibrates from detected points, with the error model chosen, hold-outs and findings as in `run`.

    Args:
        points: One entry per capture: a Detection, a pair (ids, pixels), or an array of pixels of all points of the
            target in the order of their ids (n x 2, with NaN for those that were not seen). For several cameras that
            recorded the same captures: a dictionary of such lists by the names of the cameras; None in a list stands
            for a capture of which the camera has no image.
        poses: base_from_gripper of each capture, n x 4 x 4, m.
        target: As in detect.
        setup: "eye_to_hand" or "eye_in_hand", for all cameras.
        image_size: Width and height, px; for several cameras that differ, a dictionary by their names.
        camera: The name of a camera model and its parameters; estimated from the points by default. For several
            cameras: a dictionary by the names of those whose parameters are given.
        folds: The number of folds of the cross-validation; 0: none.
        threads: As in run.
        progress: As in run, for the stage "hold-out": the points are detected already. An exception that it raises ends
            the calibration.
    """
    if setup not in ("eye_to_hand", "eye_in_hand"):
        raise Error(f"setup: {unknown_name(setup, ['eye_to_hand', 'eye_in_hand'])}")
    base_from_gripper = poses_from(poses, "poses")
    if not (isinstance(folds, int) and (folds == 0 or folds >= 2)):
        raise Error("folds: must be 0 or at least 2")
    yaml = _target_text(target)
    ids_of_target = _heba.target_ids(yaml)
    has_names = isinstance(points, Mapping)
    if not has_names and (isinstance(image_size, Mapping) or isinstance(camera, Mapping)):
        raise Error("image_size, camera: dictionaries belong to points by the names of cameras")
    if has_names and camera is not None and not isinstance(camera, Mapping):
        raise Error("camera: a dictionary by the names of the cameras is needed")
    cameras = []
    for name, entries in points.items() if isinstance(points, Mapping) else [("", points)]:
        where = f"points[{name!r}]" if has_names else "points"
        if len(entries) != len(base_from_gripper):
            raise Error(f"{where} has {len(entries)} captures, but poses has {len(base_from_gripper)}")
        captures = [
            None if entry is None and has_names else _capture(entry, f"{where}[{i}]", ids_of_target)
            for i, entry in enumerate(entries)
        ]
        width_px, height_px = _of_camera(image_size, "image_size", name)
        lens = camera.get(name) if isinstance(camera, Mapping) else camera
        given = None if lens is None else (lens[0], [float(param) for param in lens[1]])
        cameras.append((name, captures, (int(width_px), int(height_px)), given))
    unfit = [name for name, *_ in cameras if has_names and not re.fullmatch("[A-Za-z0-9_-]+", str(name))]
    if not cameras or unfit:
        raise Error(f"points: names of cameras are needed, of letters, digits, _ and -; got {unfit}")
    for key, value in (("image_size", image_size), ("camera", camera)):
        unknown = set(value) - set(points) if isinstance(value, Mapping) and has_names else set()
        if unknown:
            raise Error(f"{key}: {unknown_name(min(unknown), list(points))}")
    num_threads = threads_of(threads)
    text = interruptible(
        lambda cancellation: _heba.calibrate(
            setup, yaml, cameras, base_from_gripper, folds, num_threads, progress, cancellation
        )
    )
    return Result(text)


def _of_camera(value: Any, what: str, name: str) -> Any:
    """Returns the value of a camera: one for all, or that of its name."""
    if not isinstance(value, Mapping):
        return value
    if name not in value:
        raise Error(f"{what}: has no entry of camera {name}")
    return value[name]


def _capture(entry: Any, name: str, ids_of_target: Sequence[int]) -> tuple[list[int], np.ndarray]:
    if entry is None:
        raise Error(f"{name}: is None; a single camera has an image of every capture")
    if isinstance(entry, Detection):
        entry = (entry.ids, entry.pixels)
    if isinstance(entry, tuple) and len(entry) == 2:
        ids = [int(i) for i in np.asarray(entry[0]).ravel()]
        pixels = np.asarray(entry[1], dtype=float).reshape(-1, 2)
    else:
        pixels = np.asarray(entry, dtype=float).reshape(-1, 2)
        ids = list(ids_of_target)
        if len(pixels) != len(ids):
            raise Error(f"{name}: has {len(pixels)} points, but the target has {len(ids)}")
        seen = ~np.isnan(pixels).any(axis=1)
        ids, pixels = [i for i, is_seen in zip(ids, seen) if is_seen], pixels[seen]
    if len(ids) != len(pixels):
        raise Error(f"{name}: has {len(ids)} ids, but {len(pixels)} pixels")
    if not np.isfinite(pixels).all():
        raise Error(f"{name}: contains a number that is not finite")
    if len(set(ids)) != len(ids):
        raise Error(f"{name}: has an id twice")
    unknown = sorted(set(ids) - set(ids_of_target))
    if unknown:
        raise Error(f"{name}: the target has no point {unknown[0]}")
    return ids, np.ascontiguousarray(pixels)


def _target_text(target: Mapping[str, Any] | str) -> str:
    # JSON is YAML.
    return target if isinstance(target, str) else json.dumps(dict(target))
