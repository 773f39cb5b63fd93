"""The code on the manual's page about Python, and that of its notebook, run as they stand, in a folder with the data that
they name."""

import json
import os
import re
import shutil
from pathlib import Path

import conftest
import numpy as np
import pytest

PAGE = Path(__file__).parents[2] / "docs" / "python.md"
NOTEBOOK = PAGE.parent / "notebooks" / "first_calibration.ipynb"


def test_the_page_runs(cell, rig_cell, tmp_path, monkeypatch, capsys):
    shutil.copytree(cell, tmp_path / "cell")
    shutil.copytree(rig_cell, tmp_path / "rig")
    monkeypatch.chdir(tmp_path)
    names, poses = conftest.read_poses(cell / "poses.csv")
    # Poses of the target as a camera on the robot would see it.
    camera = conftest.matrices([[0.1, 0, 0.05, 0, 0, np.sin(0.4), np.cos(0.4)]])[0]
    pairs = [(pose, np.linalg.inv(camera) @ np.linalg.inv(pose) @ poses[0]) for pose in poses]
    np.savetxt("pairs.csv", np.array(pairs).reshape(len(pairs), -1), delimiter=",", header="numbers", fmt="%.17g")
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len(blocks) == 10
    names_of_page = {"poses": poses, "rig_poses": conftest.read_poses(rig_cell / "poses.csv")[1]}
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names_of_page)
    assert np.abs(names_of_page["t_cam2gripper"][:, 0] - camera[:3, 3]).max() < 1e-6
    assert names_of_page["located"].rms_px < 0.5
    assert names_of_page["later"].holds and len(names_of_page["plan"]) == 7
    assert names_of_page["together"][0].target == "plate"
    assert capsys.readouterr().out.count("good") >= 2
    assert os.path.exists("cell/run/report.html")


def test_the_notebook_runs(cell, tmp_path, monkeypatch, capsys):
    matplotlib = pytest.importorskip("matplotlib", reason="matplotlib is not there: the notebook draws a plot")
    matplotlib.use("Agg")
    shutil.copytree(cell / "images", tmp_path / "cell" / "images")
    shutil.copy(cell / "poses.csv", tmp_path / "cell" / "robot_log.csv")
    monkeypatch.chdir(tmp_path)
    names_of_notebook = {}
    cells = [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]
    for source in ("".join(cell["source"]) for cell in cells):
        exec(compile(source, str(NOTEBOOK), "exec"), names_of_notebook)
    assert all(not cell["outputs"] for cell in cells)  # Outputs would age.
    assert "good" in capsys.readouterr().out
    assert names_of_notebook["result"].verdict["grade"] == "good"
    assert len(names_of_notebook["axes"].patches) > 0
