"""The code on the manual's page about Python runs as it stands, in one folder with the data that the page names."""

import os
import re
import shutil
from pathlib import Path

import conftest
import numpy as np

PAGE = Path(__file__).parents[2] / "docs" / "python.md"


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
    assert len(blocks) == 9
    names_of_page = {"poses": poses, "rig_poses": conftest.read_poses(rig_cell / "poses.csv")[1]}
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names_of_page)
    assert np.abs(names_of_page["t_cam2gripper"][:, 0] - camera[:3, 3]).max() < 1e-6
    assert names_of_page["located"].rms_px < 0.5
    assert names_of_page["later"].holds and len(names_of_page["plan"]) == 7
    assert names_of_page["together"][0].target == "plate"
    assert capsys.readouterr().out.count("good") >= 2
    assert os.path.exists("cell/run/report.html")
