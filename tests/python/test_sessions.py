"""Sessions before, during and after a calibration, beside the program's own results."""

import json
import os
import shutil
import signal
import threading
import time

import conftest
import numpy as np
import pytest

import heba


SCENE_OF_DICTIONARY = {
    "setup": "eye_to_hand",
    "target": {"type": "chessboard", "rows": 6, "columns": 7, "square": "30 mm"},
    "camera": {"model": "pinhole", "image_size": [640, 480], "fx": 600, "fy": 600, "cx": 320, "cy": 240},
    "hand_eye": {"translation": ["1050 mm", "50 mm", "400 mm"], "rpy": ["-88 deg", "3 deg", "91 deg"]},
    "board": {"translation": ["50 mm", "-30 mm", "60 mm"], "rpy": ["178 deg", "3 deg", "20 deg"]},
    "motion": {"captures": 10, "distance": "500 mm", "tilt": "25 deg"},
}


@pytest.fixture(scope="module")
def later(tmp_path_factory):
    """A session of the cell: in place, and one whose camera was knocked by 4 mm."""
    folder = tmp_path_factory.mktemp("later")
    cells = {}
    for name, x_mm in (("same", 1050), ("knocked", 1054)):
        scene = folder / f"{name}.yaml"
        scene.write_text(conftest.SCENE.format(setup="eye_to_hand", x=x_mm))
        cells[name] = heba.simulate(scene, folder / name, settings={"seed": 8, "motion.captures": 5}).parent
    return cells


def images_and_poses(cell):
    names, poses = conftest.read_poses(cell / "poses.csv")
    return [cell / "images" / name for name in names], poses


def test_simulate_writes_what_the_program_writes(tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(conftest.SCENE.format(setup="eye_to_hand", x=1050))
    config = heba.simulate(scene, tmp_path / "by_python", settings={"motion": {"captures": 5}})
    conftest.program("simulate", scene, "--set", "motion.captures=5", "--out", tmp_path / "by_program")
    files = sorted(file.relative_to(config.parent) for file in config.parent.rglob("*") if file.is_file())
    assert config.name == "config.yaml" and len(files) > 5
    for file in files:
        assert (config.parent / file).read_bytes() == (tmp_path / "by_program" / file).read_bytes(), file
    by_dictionary = heba.simulate(SCENE_OF_DICTIONARY, tmp_path / "by_dictionary")
    assert heba.run(by_dictionary, out=tmp_path / "run").verdict["grade"] == "good"
    with pytest.raises(heba.Error, match="settings: motion: unknown key 'capture'"):
        heba.simulate(scene, tmp_path / "other", settings={"motion.capture": 5})


def test_plan_gives_the_poses_that_the_program_writes(program_run, tmp_path):
    plan = heba.plan(program_run, 4)
    assert len(plan) == len(plan.images) == 7  # With three that are taken once more.
    assert plan.poses.shape == (7, 4, 4) and plan.joints is None
    assert np.all(np.diff(plan.target_sigma[:4]) < 0) and np.all(plan.visible >= 0.95)
    told = conftest.program("plan", program_run, "--count", "4", "--out", tmp_path / "poses.csv").stdout
    assert told.split()[: len(plan.table.split())] == plan.table.split()
    names, poses = conftest.read_poses(tmp_path / "poses.csv")
    assert names == list(plan.images)
    assert np.allclose(poses, plan.poses, atol=1e-6)
    assert heba.plan(heba.Result.read(program_run), 4).images == plan.images


def test_plan_takes_a_dictionary_and_names_its_keys(program_run):
    with pytest.raises(heba.Error, match="^count: must be a whole number from 5 to 500"):
        heba.plan(program_run, 4, procedure="two_step")
    with pytest.raises(heba.Error, match="^procedure: 'twostep' is unknown; did you mean 'two_step'"):
        heba.plan(program_run, procedure="twostep")
    rough = {key: SCENE_OF_DICTIONARY[key] for key in ("setup", "target", "camera")}
    place = {"hand_eye": SCENE_OF_DICTIONARY["hand_eye"], "board": SCENE_OF_DICTIONARY["board"]}
    with pytest.raises(heba.Error, match="^config: plan.hand_eye and plan.board are needed"):
        heba.plan(rough)
    rough["camera"] = {"model": "pinhole"}
    place["workspace"] = {"box": [["0 mm", "-500 mm", "-100 mm"], ["800 mm", "500 mm", "800 mm"]]}
    place["lens"] = {"focal_length": "6 mm", "pixel": "0.01 mm", "image_size": [640, 480]}
    assert len(heba.plan({**rough, "plan": place}, np.int64(6))) == 9
    with pytest.raises(heba.Error, match="^count: must be a whole number from 1 to 500"):
        heba.plan({**rough, "plan": place}, True)


def test_an_interrupt_from_the_keyboard_does_not_wait_for_the_plan(program_run):
    timer = threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        heba.plan(program_run, 400)
    assert time.monotonic() - begin < 5
    for thread in threading.enumerate():
        if thread.name == "heba":
            thread.join()


def test_check_decides_as_the_program_does(program_run, later):
    images, poses = images_and_poses(later["same"])
    held = heba.check(program_run, images, poses=poses, target="in-place")
    assert held.holds and held.body is None and held.change is None and held.notes == ()
    by_file = heba.check(program_run, images, poses=later["same"] / "poses.csv", target="in-place")
    assert by_file.data["p_value"] == pytest.approx(held.data["p_value"], rel=1e-6)
    arguments = ["--poses", later["same"] / "poses.csv", "--target", "in-place", "--json"]
    assert by_file.data == json.loads(conftest.program("check", program_run, *images, *arguments).stdout)


def test_check_names_what_was_moved(program_run, later):
    images, poses = images_and_poses(later["knocked"])
    check = heba.check(heba.Result.read(program_run), images, poses=poses, target="in-place")
    assert check.decision == "moved" and check.body == "camera"
    assert np.linalg.norm(check.change["translation_mm"]) == pytest.approx(4, abs=0.5)


def test_check_without_a_robot(program_run, later):
    images, _ = images_and_poses(later["same"])
    assert heba.check(program_run, images[0], reference=images[0]).holds
    check = heba.check(program_run, images[1], reference=images[0])
    assert check.decision == "moved"
    with pytest.raises(heba.Error, match="^reference: says nothing about a camera if the target was moved"):
        heba.check(program_run, images[1], reference=images[0], target="moved")
    with pytest.raises(heba.Error, match="^reference: takes the place of the robot's poses"):
        heba.check(program_run, images[1], reference=images[0], poses=np.eye(4))
    with pytest.raises(heba.Error, match="^target: 'in_place' is unknown; did you mean 'in-place'"):
        heba.check(program_run, images[1], reference=images[0], target="in_place")


def test_check_says_what_it_needs(program_run, later, tmp_path):
    images, poses = images_and_poses(later["same"])
    with pytest.raises(heba.Error, match='^target: "in-place" or "moved" is needed'):
        heba.check(program_run, images, poses=poses)
    with pytest.raises(heba.Error, match="^poses: there are 4 of 5 images"):
        heba.check(program_run, images, poses=poses[:4], target="moved")
    with pytest.raises(heba.Error, match="^poses: the run has only one, without a name"):
        heba.check(program_run, images, poses={"left": poses}, target="moved")
    with pytest.raises(heba.Error, match="^joints: must be 5 rows of numbers"):
        heba.check(program_run, images, poses=poses, joints=[[0.0] * 6], target="moved")
    with pytest.raises(heba.Error, match="^poses: those of the arm are needed"):
        heba.check(program_run, images, poses={}, target="moved")
    with pytest.raises(heba.Error, match="^images: must be paths of images"):
        heba.check(program_run, 3, poses=poses, target="moved")
    with pytest.raises(heba.Error, match="^images: the run has only one, without a name"):
        heba.check(program_run, {"right": images}, poses=poses, target="moved")
    with pytest.raises(heba.Error, match="nothing.png"):
        heba.check(program_run, [tmp_path / "nothing.png"], poses=poses[:1], target="moved")
    # Poses in mm put the target out of the camera's view.
    far = poses.copy()
    far[:, :3, 3] *= 1000
    undecided = heba.check(program_run, images, poses=far, target="in-place")
    assert undecided.decision == "undecided" and undecided.reason and not undecided.holds


def recorded_folder(cell, folder):
    """Copies the images and the poses of a cell, as a user has them: without a config and with the robot's own header."""
    shutil.copytree(cell / "images", folder / "images")
    shutil.copy(cell / "poses.csv", folder / "robot_log.csv")
    return folder


def test_init_makes_the_config_that_the_program_makes(cell, tmp_path):
    by_python = recorded_folder(cell, tmp_path / "by_python")
    by_program = recorded_folder(cell, tmp_path / "by_program")
    target = {"type": "chessboard", "rows": 6, "columns": 7, "square": "30 mm"}
    config = heba.init(by_python, target)
    conftest.program("init", by_program, "--target", json.dumps(target))
    assert config == by_python / "config.yaml"
    # Comments name the folder.
    assert config.read_text().replace("by_python", "by_program") == (by_program / "config.yaml").read_text()
    assert heba.run(config, out=tmp_path / "run").verdict["grade"] == "good"
    with pytest.raises(heba.Error, match="config.yaml: exists already; remove it, or name another file \\(out\\)"):
        heba.init(by_python, target)
    assert heba.init(by_python, target, force=True) == config


def test_init_says_what_is_missing_and_writes_nothing(cell, tmp_path):
    folder = recorded_folder(cell, tmp_path / "cell")
    with pytest.raises(heba.Error, match='contains no target file; the images show target="{type: chessboard, rows: 6'):
        heba.init(folder)
    with pytest.raises(heba.Error, match="setup: .*did you mean 'eye_to_hand'"):
        heba.init(folder, setup="eye_to_hnd")
    with pytest.raises(heba.Error, match="images: absent: no such file or folder"):
        heba.init(folder, images="absent")
    assert sorted(file.name for file in folder.iterdir()) == ["images", "robot_log.csv"]
    # Faults of the data are warnings.
    with pytest.warns(UserWarning, match="another target than the config names"):
        heba.init(folder, {"type": "chessboard", "rows": 5, "columns": 5, "square": "30 mm"})
