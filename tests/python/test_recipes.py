"""The recipes of docs/recipes record a cell, with stand-ins for the robot, the camera and ROS, and heba calibrates it."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import conftest
import pytest

HERE = Path(__file__).parent
RECIPES = HERE.parents[1] / "docs" / "recipes"


def arguments(recipe, folder):
    return {
        "record_ur_realsense": ["192.168.0.2", folder],
        "record_franka_opencv": ["192.168.0.2", "0", folder],
        "record_ros2": ["--ros-args", "-p", f"folder:={folder}"],
    }[recipe]


def test_every_recipe_is_tested():
    assert {file.stem for file in RECIPES.glob("*.py")} == {"record_ur_realsense", "record_franka_opencv", "record_ros2"}


@pytest.mark.parametrize("recipe", ["record_ur_realsense", "record_franka_opencv", "record_ros2"])
def test_heba_reads_what_a_recipe_records(recipe, cell, tmp_path):
    folder = tmp_path / "recorded"
    command = [sys.executable, HERE / "recipe_stubs.py", cell, RECIPES / f"{recipe}.py", *arguments(recipe, folder)]
    ended = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    )
    assert ended.returncode == 0, ended.stderr
    rows = list(csv.DictReader(open(folder / "poses.csv")))
    assert len(rows) == len(list((folder / "images").iterdir())) == len(list((cell / "images").iterdir()))
    assert all(float(row["time"]) > 0 for row in rows)
    # What a user edits: where the camera is, and the target.
    config = folder / "config.yaml"
    config.write_text(
        config.read_text().replace("setup: eye_in_hand", "setup: eye_to_hand") + "evaluate: {folds: 0}\n"
    )
    (folder / "target.yaml").write_text((cell / "target.yaml").read_text())
    conftest.program("run", config, "--out", folder / "run", "--quiet")
    found = json.loads((folder / "run" / "result.json").read_text())["estimates"][-1]["hand_eye"]["translation_m"]
    truth = json.loads((cell / "truth.json").read_text())["hand_eye"]["translation_m"]
    assert max(abs(a - b) for a, b in zip(found, truth)) < 2e-3
