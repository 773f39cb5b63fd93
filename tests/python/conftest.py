"""Fixtures: a rendered cell, and its run by the program."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

PROGRAM = os.environ["HEBA_PROGRAM"]
DATA = Path(os.environ.get("HEBA_DATA_DIR", Path(__file__).parents[3] / "shared" / "data"))

SCENE = """
setup: {setup}
target: {{type: chessboard, rows: 6, columns: 7, square: 30 mm}}
camera: {{model: brown5, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240,
          distortion: [-0.08, 0.05, 0.0, 0.0, 0.0]}}
hand_eye: {{translation: [{x} mm, 50 mm, 400 mm], rpy: [-88 deg, 3 deg, 91 deg]}}
board: {{translation: [50 mm, -30 mm, 60 mm], rpy: [178 deg, 3 deg, 20 deg]}}
motion: {{captures: 12, distance: 500 mm, depth: 0.2, tilt: 25 deg, spin: 60 deg, spread: 0.3}}
seed: 3
"""


RIG_CAMERA = "{model: brown5, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240, distortion: [-0.08, 0.05, 0, 0, 0]}"
RIG_SCENE = f"""
cameras:
  left:
    mount: world
    pose: {{translation: [500 mm, 600 mm, 700 mm], rpy: [-110 deg, 0 deg, 175 deg]}}
    camera: {RIG_CAMERA}
  right:
    mount: world
    pose: {{translation: [700 mm, 550 mm, 600 mm], rpy: [-105 deg, 0 deg, 165 deg]}}
    camera: {RIG_CAMERA}
  wrist:
    mount: gripper
    pose: {{translation: [60 mm, 0 mm, 40 mm], rpy: [5 deg, -5 deg, 90 deg]}}
    camera: {RIG_CAMERA}
targets:
  plate:
    mount: gripper
    pose: {{translation: [0 mm, -50 mm, 80 mm], rpy: [90 deg, 0 deg, 0 deg]}}
    target: {{type: charuco, rows: 6, columns: 8, square: 22 mm, marker: 16 mm, dictionary: DICT_4X4_250}}
  wall:
    mount: world
    pose: {{translation: [900 mm, -400 mm, 200 mm], rpy: [180 deg, 0 deg, 0 deg]}}
    target: {{type: charuco, rows: 6, columns: 8, square: 30 mm, marker: 22 mm, dictionary: DICT_4X4_250,
              first_marker: 100}}
motion: {{captures: 12, distance: 600 mm, tilt: 30 deg}}
image: {{noise: 2 grey}}
robot_noise: {{translation: 0.1 mm, rotation: 0.02 deg}}
seed: 2
"""


def program(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], check=True, capture_output=True, text=True)


def simulate(folder, setup, x_mm):
    scene = folder / "scene.yaml"
    scene.write_text(SCENE.format(setup=setup, x=x_mm))
    program("simulate", scene, "--out", folder / "cell", "--quiet")
    return folder / "cell"


@pytest.fixture(scope="session")
def cell(tmp_path_factory):
    """The folder of a rendered cell with a stationary camera."""
    return simulate(tmp_path_factory.mktemp("fixed"), "eye_to_hand", 1050)


@pytest.fixture(scope="session")
def carried(tmp_path_factory):
    """The folder of a rendered cell whose robot carries the camera."""
    return simulate(tmp_path_factory.mktemp("carried"), "eye_in_hand", 60)


@pytest.fixture(scope="session")
def rig_cell(tmp_path_factory):
    """The folder of a rendered cell with two fixed cameras, one on the gripper, a target on the gripper and one on a wall."""
    folder = tmp_path_factory.mktemp("rig")
    (folder / "scene.yaml").write_text(RIG_SCENE)
    program("simulate", folder / "scene.yaml", "--out", folder / "cell", "--quiet")
    return folder / "cell"


@pytest.fixture(scope="session")
def program_run(cell, tmp_path_factory):
    """The folder that `heba run` writes for the cell."""
    out = tmp_path_factory.mktemp("program") / "run"
    program("run", cell / "config.yaml", "--out", out, "--quiet")
    return out


def read_poses(file):
    """Returns the names and poses, n x 4 x 4, of a poses file of the format `ros`."""
    rows = [line.split(",") for line in file.read_text().splitlines() if line and not line.startswith("#")]
    rows = [row for row in rows if row[1].strip().lstrip("-")[0].isdigit()]
    numbers = np.array([[float(number) for number in row[1:8]] for row in rows])
    return [row[0] for row in rows], matrices(numbers)


def matrices(numbers):
    """Returns 4 x 4 matrices from rows of x, y, z, qx, qy, qz, qw."""
    poses = np.tile(np.eye(4), (len(numbers), 1, 1))
    for pose, (tx, ty, tz, x, y, z, w) in zip(poses, numbers):
        pose[:3, 3] = tx, ty, tz
        pose[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    return poses


def recorded_pairs(name):
    """Returns the poses A (of the robot) and B (of the target in the camera) of a recorded set; skips without it."""
    file = DATA / name / "pairs.csv"
    if not file.exists():
        pytest.skip(f"the recorded set {name} is not there ({DATA})")
    numbers = np.genfromtxt(file, delimiter=",", skip_header=1)
    return matrices(numbers[:, 1:8]), matrices(numbers[:, 8:15])
