"""Sessions before, during and after a calibration: recorded, simulated, planned and checked ones."""

from __future__ import annotations

import json
import os
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Mapping, Sequence

from . import _heba
from ._arguments import PathLike, Settings, config_file, entries_of, folder_of, interruptible, threads_of
from ._arrays import joints_from, poses_from
from ._heba import Error, unknown_name
from ._numpy import needs_numpy, np
from ._plots import plot_poses
from ._result import Result


@dataclass(frozen=True)
class Plan:
    """The poses of a session. All arrays have one entry per capture, in the order in which they are to be taken.

    Attributes:
        images: The names of the images.
        poses: base_from_gripper, n x 4 x 4, m.
        joints: The positions of the arm's joints, n x joints, rad or m; None without an arm.
        visible: The share of rough set-ups in which the camera sees the whole target.
        target_sigma: One sigma of the position of a located target that is expected after the capture, m.
        position_sigma: Likewise of the camera's position, m.
        orientation_sigma: Likewise of the camera's orientation, rad.
        table: What `heba plan` prints.
    """

    images: tuple[str, ...]
    poses: np.ndarray
    joints: np.ndarray | None
    visible: np.ndarray
    target_sigma: np.ndarray
    position_sigma: np.ndarray
    orientation_sigma: np.ndarray
    table: str

    def __len__(self) -> int:
        return len(self.images)

    @needs_numpy
    def plot(self, axes: Any = None) -> Any:
        """Draws the positions of the gripper and its axes, and returns matplotlib's axes (3-D, m)."""
        return plot_poses(self.poses, self.images, axes)


@dataclass(frozen=True)
class Check:
    """What images of a later session say about a calibration.

    Attributes:
        decision: "holds", "moved", or "undecided".
        body: What was moved: "camera", "target", "lens" or "base", with its name if it has one; None if nothing was, or if
            one image contradicts the others (`data["contradicting"]`).
        change: How far, as the file states it (translation_mm, rotation_deg, sigma_mm, sigma_deg, ...); likewise.
        reason: Why there is no decision; else empty.
        notes: A sentence for each image that is not used.
        data: The whole file of `heba check --json`.
    """

    decision: str
    body: str | None
    change: dict[str, Any] | None
    reason: str
    notes: tuple[str, ...]
    data: dict[str, Any]

    @property
    def holds(self) -> bool:
        return self.decision == "holds"


def init(
    folder: PathLike,
    target: PathLike | Mapping[str, Any] | None = None,
    *,
    out: PathLike | None = None,
    images: PathLike | None = None,
    poses: PathLike | None = None,
    camera: PathLike | None = None,
    setup: str | None = None,
    force: bool = False,
    threads: int | None = None,
) -> Path:
    """Makes a config of a folder of images and poses, as `heba init` does, and returns its path.

    Setup, units, angles and direction of the poses are those under which robot and images agree best.

    Args:
        folder: The folder with the images and the poses, or a data set of another project.
        target: The path of the target's file, or its keys as a dictionary; a file in the folder needs none.
        out: The config to write; by default config.yaml in the folder.
        images: The folder of the images, if it is not to be found.
        poses: The file or folder of the poses; likewise.
        camera: A camera file, which gives the intrinsics.
        setup: "eye_to_hand" or "eye_in_hand", if the images are not to decide.
        force: Whether a config that `init` has written may be replaced.
        threads: As in run.

    Raises:
        heba.Error: Robot and images do not fit, or something is missing; nothing is written then.
    """
    keys = json.dumps(target) if isinstance(target, Mapping) else _text_of(target)
    stated = [_text_of(path) for path in (images, poses, camera)]
    config, faults, _ = _heba.init(Path(folder), _text_of(out), *stated, keys, setup or "", force, threads_of(threads))
    for fault in faults:
        warnings.warn(fault, stacklevel=2)
    return config


def _text_of(path: PathLike | None) -> str:
    return "" if path is None else os.fspath(path)


def simulate(
    scene: PathLike | Mapping[str, Any], out: PathLike, *, settings: Settings = (), threads: int | None = None
) -> Path:
    """Renders the data set of a scene, as `heba simulate` does, and returns the config for a run of it.

    Args:
        scene: The path of a scene, or its contents as a dictionary; paths in it are then relative to the current folder.
        out: The folder of the data set, which must be new.
        settings: As in run.
        threads: As in run.
    """
    with config_file(scene, has_name=False) as file:
        return _heba.simulate(file, entries_of(settings), Path(out), threads_of(threads))


@needs_numpy
def plan(
    cell: PathLike | Mapping[str, Any] | Result,
    count: int = 15,
    *,
    procedure: str | None = None,
    settings: Settings = (),
) -> Plan:
    """Plans the poses of a session, as `heba plan` does, without writing files.

    Args:
        cell: The path of a cell's file, its contents as a dictionary, or the folder or the result of a run, which the
            planned captures then extend.
        count: The number of captures, without those that are taken once more at the end.
        procedure: "two_step" for the motions of the two-step method.
        settings: As in run.
    """
    if procedure not in (None, "two_step"):
        raise Error(f"procedure: {unknown_name(str(procedure), ['two_step'])}")
    fewest = 5 if procedure else 1
    if isinstance(count, bool) or not hasattr(count, "__index__") or not fewest <= count <= 500:
        raise Error(f"count: must be a whole number from {fewest} to 500")
    with config_file(folder_of(cell, "plan") if isinstance(cell, Result) else cell) as file:
        entries = entries_of(settings)
        captures, table = interruptible(lambda _: _heba.plan(file, entries, int(count), procedure is not None))
    images, poses, joints, visible, target, position, orientation = zip(*captures)
    return Plan(
        images,
        np.array(poses),
        np.array(joints) if joints[0] else None,
        np.array(visible),
        np.array(target),
        np.array(position),
        np.array(orientation),
        table,
    )


@needs_numpy
def check(
    run_folder: PathLike | Result,
    images: PathLike | Sequence[PathLike] | Mapping[str, PathLike | Sequence[PathLike]],
    *,
    poses: Any = None,
    joints: Any = None,
    target: str | None = None,
    reference: PathLike | None = None,
    threads: int | None = None,
) -> Check:
    """Checks whether a calibration still holds, as `heba check` does.

    Args:
        run_folder: The folder of the run, or its result.
        images: The paths of images of the target; of several cameras: a dictionary of them by the cameras' names.
        poses: base_from_gripper of each image, n x 4 x 4, m, as the robot states it, or the path of a file of poses in
            the format of the run; of several arms: a dictionary by their names. Those of several cameras follow each
            other in the order of the dictionary of images. Images at equal poses are one capture.
        joints: The positions of the joints, n x joints, rad or m, or the path of a file of them, if the run has
            estimated the errors of the arm; likewise.
        target: "in-place" if the target is mounted exactly as it was for the calibration, "moved" if not.
        reference: In place of poses and target: an earlier image of the same target by the same camera, or a folder of
            them; both must stand still.
        threads: As in run.
    """
    folder = folder_of(run_folder, "check")
    by_camera = images if isinstance(images, Mapping) else {"": images}
    try:
        named = [
            (str(name), Path(image))
            for name, of_camera in by_camera.items()
            for image in ([of_camera] if isinstance(of_camera, (str, os.PathLike)) else of_camera)
        ]
    except TypeError:
        raise Error("images: must be paths of images") from None
    if not named:
        raise Error("images: there are none")
    if target not in (None, "in-place", "moved"):
        raise Error(f"target: {unknown_name(str(target), ['in-place', 'moved'])}")
    if reference is not None:
        if poses is not None or joints is not None:
            raise Error("reference: takes the place of the robot's poses; leave out poses and joints")
        if target == "moved":
            raise Error("reference: says nothing about a camera if the target was moved")
        if not os.fspath(reference):
            raise Error("reference: is empty")
        arms = []
    else:
        if target is None:
            raise Error('target: "in-place" or "moved" is needed: whether it is mounted as it was for the calibration')
        if poses is None:
            raise Error("poses: the robot's poses at the images are needed; without a robot, a reference image")
        arms = _arms(poses, joints, len(named))
    earlier = None if reference is None else Path(reference)
    num_threads = threads_of(threads)
    text, notes = interruptible(
        lambda _: _heba.check(folder, named, arms, target == "in-place", earlier, num_threads)
    )
    data = json.loads(text)
    return Check(
        data["decision"], data.get("body"), data.get("change"), data.get("reason", ""), tuple(notes), data
    )


def _arms(poses: Any, joints: Any, num_images: int) -> list[tuple[str, Any, str, list[list[float]], str]]:
    """Returns for each arm its name, its poses or their file, and its joints or their file."""
    if joints is not None and isinstance(joints, Mapping) != isinstance(poses, Mapping):
        raise Error("joints: must be a dictionary if the poses are one, and none if they are none")
    joints_of = joints if isinstance(joints, Mapping) else {} if joints is None else {"": joints}
    poses_of = poses if isinstance(poses, Mapping) else {"": poses}
    for name in joints_of:
        if name not in poses_of:
            raise Error(f"joints: {unknown_name(str(name), list(map(str, poses_of)))}")
    arms = []
    for name, given in poses_of.items():
        positions = joints_of.get(name)
        is_file = isinstance(given, (str, os.PathLike))
        if positions is not None and is_file != isinstance(positions, (str, os.PathLike)):
            raise Error("joints: must be a file if the poses are one, and an array if they are an array")
        if is_file:
            arms.append((str(name), None, os.fspath(given), [], os.fspath(positions or "")))
            continue
        matrices = poses_from(given, f"poses {name}".rstrip())
        if len(matrices) != num_images:
            raise Error(f"poses {name}".rstrip() + f": there are {len(matrices)} of {num_images} images")
        rows = [] if positions is None else joints_from(positions, num_images, f"joints {name}".rstrip())
        arms.append((str(name), matrices, "", rows, ""))
    return arms
