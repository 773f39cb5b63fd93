"""Runs, detection, location, calibration from arrays and the doctor, beside the program's own results."""

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import conftest
import numpy as np
import pytest

import heba


def without_times(result):
    """Returns the contents of result.json without the times that the work took."""
    data = dict(result)
    del data["timing_s"]
    for estimate in data["estimates"]:
        if estimate["solve"]:
            del estimate["solve"]["seconds"]
    return data


def truth_of(cell):
    return json.loads((cell / "truth.json").read_text())


def test_run_writes_what_the_program_writes(cell, program_run, tmp_path):
    result = heba.run(cell / "config.yaml", out=tmp_path / "run", threads=1)
    program = json.loads((program_run / "result.json").read_text())
    assert json.dumps(without_times(result.data)) == json.dumps(without_times(program))
    assert {file.name for file in (tmp_path / "run").iterdir()} == {file.name for file in program_run.iterdir()}
    assert result.folder == tmp_path / "run"
    assert result.verdict["grade"] == "good"
    assert "bundle" in result.table()
    truth = truth_of(cell)["hand_eye"]["translation_m"]
    assert np.linalg.norm(result.hand_eye[:3, 3] - truth) < 1e-3
    assert result.covariance.shape == (6, 6)
    assert np.all(np.linalg.eigvalsh(result.covariance) > 0)
    # The parts have no names of their own.
    camera, target, arm = result.cameras["camera"], result.targets["target"], result.robots["robot"]
    assert np.array_equal(camera.pose, result.hand_eye) and camera.mount == "base"
    assert np.array_equal(camera.covariance, result.covariance)
    assert np.array_equal(target.pose, result.board) and target.mount == "gripper" and target.covariance.shape == (6, 6)
    assert np.array_equal(arm.pose, np.eye(4)) and arm.covariance is None


def test_dictionaries_are_configs(cell, tmp_path, monkeypatch):
    monkeypatch.chdir(cell)
    config = {
        "setup": "eye_to_hand",
        "target": "target.yaml",
        "camera": {"model": "brown5", "intrinsics": "camera.yaml"},
        "captures": {"images": "images", "poses": "poses.csv", "pose_format": "ros"},
    }
    before = set(cell.iterdir())
    result = heba.run(config, settings=["evaluate.folds=3"], out=tmp_path / "run")
    assert result.verdict["grade"] == "good"
    assert set(cell.iterdir()) == before


def test_a_position_without_a_valid_uncertainty_is_refused(cell, program_run, tmp_path):
    shutil.copytree(program_run, tmp_path / "run")
    file = tmp_path / "run" / "result.json"
    result = json.loads(file.read_text())
    # Every two of the hand-eye pose's parameters may be correlated like this, but not all of them together: the
    # variance of the position along one of the base's axes becomes negative.
    sigmas = 0.01 * np.array([1, 1, 1, -2, 2, -2])
    covariance = np.outer(sigmas, sigmas) * (1.9 * np.eye(6) - 0.9)
    for estimate in result["estimates"]:
        if estimate["method"] == "bundle":
            for i in range(6):
                estimate["covariance"]["matrix"][i][:6] = covariance[i].tolist()
    file.write_text(json.dumps(result))
    with pytest.raises(heba.Error, match="not a finite number"):
        heba.locate(tmp_path / "run", cell / "images" / "000.png")


def test_progress_is_told_and_can_end_a_run(cell, tmp_path):
    told = []
    heba.run(cell / "config.yaml", out=tmp_path / "run", progress=lambda *step: told.append(step))
    assert ("detection", 12, 12) in told
    assert ("hold-out", 5, 5) in told

    class Stop(Exception):
        pass

    def stop(stage, done, total):
        raise Stop

    with pytest.raises(Stop):
        heba.run(cell / "config.yaml", out=tmp_path / "stopped", progress=stop)
    assert not (tmp_path / "stopped").exists()


def test_an_interrupt_from_the_keyboard_does_not_wait_for_the_run(cell, tmp_path):
    def interrupt(stage, done, total):
        if (stage, done) == ("detection", 1):
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        heba.run(cell / "config.yaml", out=tmp_path / "run", threads=1, progress=interrupt)
    for thread in threading.enumerate():
        if thread.name == "heba":
            thread.join()
    assert not (tmp_path / "run").exists()


def test_settings_may_be_dictionaries(cell, program_run, tmp_path):
    settings = {"evaluate": {"folds": 3}, "refine.target_shape": ["scale"], "camera.model": "brown5"}
    result = heba.run(cell / "config.yaml", settings=settings, out=tmp_path / "run")
    assert result.data["model"]["target_shape"] == ["scale"]
    with pytest.raises(heba.Error, match="^settings: evaluate: unknown key 'fold'"):
        heba.run(cell / "config.yaml", settings={"evaluate": {"fold": 3}})


def test_errors_of_a_dictionary_name_its_keys():
    with pytest.raises(heba.Error, match="^config: ") as error:
        heba.run({"setup": "eye_to_hand", "captures": {"images": "images"}, "targte": {}})
    assert ".heba-" not in str(error.value)


def test_results_have_what_other_libraries_take(cell, program_run, tmp_path):
    result = heba.Result.read(program_run)
    camera = result.estimate()["camera"]
    assert result.camera_model == camera["model"]
    assert np.array_equal(result.camera_matrix, [[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])
    assert list(result.distortion) == camera["distortion"]
    assert np.allclose(result.sigma**2, np.diag(result.covariance))
    assert result.report_path == program_run / "report.html"
    exported = conftest.program("export", program_run, "--to", "ros").stdout
    assert list(result.export("ros", tmp_path).values()) == [exported]
    assert [file.read_text() for file in tmp_path.iterdir()] == [exported]
    with pytest.raises(heba.Error, match="did you mean 'ros'"):
        result.export("rso")
    shown = result._repr_html_()
    assert result.verdict["grade"] in shown and "bundle" in shown and "<iframe" in shown


def test_the_base_of_a_universal_robots_arm_is_called_as_by_the_program(program_run, tmp_path):
    run = tmp_path / "run"
    shutil.copytree(program_run, run)
    config = run / "config.yaml"
    config.write_text(re.sub(r"(?m)^( *)pose_format:.*$", r"\1pose_format: ur", config.read_text()))
    exported = heba.Result.read(run).export("ros")
    assert "camera_optical_frame in base_link" in "".join(heba.Result.read(program_run).export("ros").values())
    assert "camera_optical_frame in base\n" in "".join(exported.values())
    assert list(exported.values()) == [conftest.program("export", run, "--to", "ros").stdout]


def test_errors_are_the_lines_of_the_program(tmp_path):
    with pytest.raises(heba.Error, match="there is no such file"):
        heba.run(tmp_path / "missing.yaml")
    with pytest.raises(ValueError, match="chesboard.*chessboard"):
        heba.detect(np.zeros((10, 10), np.uint8), {"type": "chesboard"})
    with pytest.raises(heba.Error, match="uint8"):
        heba.detect(np.zeros((10, 10)), {"type": "chessboard", "rows": 6, "columns": 8, "square": "30 mm"})


def test_detection_and_location(cell, program_run):
    image = sorted((cell / "images").iterdir())[0]
    target = (cell / "target.yaml").read_text()
    of_file = heba.detect(image, target)
    assert len(of_file) == 42
    assert of_file.pixels.shape == (42, 2) and of_file.points.shape == (42, 3)
    cv2 = pytest.importorskip("cv2")
    grey = cv2.imread(str(image), cv2.IMREAD_GRAYSCALE)
    of_array = heba.detect(grey, target)
    assert np.array_equal(of_array.pixels, of_file.pixels)
    # A part of an image has rows that do not follow one another.
    assert len(heba.detect(np.pad(grey, 3)[3:-3, 3:-3], target)) == 42

    names, poses = conftest.read_poses(cell / "poses.csv")
    board = heba.Result.read(program_run).board
    expected = poses[names.index(image.name)] @ board
    for located in (heba.locate(program_run, image), heba.locate(heba.Result.read(program_run), grey)):
        assert len(located) == 1
        assert np.abs(located[0].base_from_target - expected).max() < 1e-3
        assert np.sqrt(np.linalg.eigvalsh(located[0].covariance).max()) < 1e-3
    with pytest.raises(heba.Error, match="stationary"):
        heba.locate(program_run, image, pose=np.eye(4))
    with pytest.raises(heba.Error, match="640 x 480"):
        heba.locate(program_run, grey[:-1])


def test_carried_camera_needs_the_pose(carried, tmp_path):
    result = heba.run(carried / "config.yaml", out=tmp_path / "run")
    names, poses = conftest.read_poses(carried / "poses.csv")
    image = carried / "images" / names[3]
    located = heba.locate(result, image, pose=poses[3])[0]
    assert np.abs(located.base_from_target - result.board).max() < 1e-3
    with pytest.raises(heba.Error, match="pose"):
        heba.locate(result, image)


def test_calibration_from_arrays(cell, program_run):
    target = (cell / "target.yaml").read_text()
    names, poses = conftest.read_poses(cell / "poses.csv")
    seen = [heba.detect(cell / "images" / name, target) for name in names]
    result = heba.calibrate(seen, poses, target, setup="eye_to_hand", image_size=(640, 480), folds=0)
    truth = truth_of(cell)["hand_eye"]["translation_m"]
    assert np.linalg.norm(result.hand_eye[:3, 3] - truth) < 1e-3
    assert "bundle" in result.table()
    # Arrays of all points, of which some were not seen.
    grids = [detection.pixels.copy() for detection in seen]
    grids[0][:5] = np.nan
    of_grids = heba.calibrate(grids, poses, target, setup="eye_to_hand", image_size=(640, 480), folds=0)
    assert np.abs(of_grids.hand_eye - result.hand_eye).max() < 1e-3
    with pytest.raises(heba.Error, match=r"points\[0\]: the target has no point 1000"):
        heba.calibrate([([1000], [[1, 2]])] * 12, poses, target, setup="eye_to_hand", image_size=(640, 480))
    with pytest.raises(heba.Error, match="rotation"):
        heba.calibrate(seen, poses * [[2], [2], [2], [1]], target, setup="eye_to_hand", image_size=(640, 480))
    with pytest.raises(heba.Error, match="11"):
        heba.calibrate(seen, poses[1:], target, setup="eye_to_hand", image_size=(640, 480))


def test_doctor_names_wrong_poses(cell):
    assert not [symptom for symptom in heba.doctor(cell / "config.yaml") if symptom.is_wrong]
    # Poses in the wrong direction are a fault.
    wrong = heba.doctor(cell / "config.yaml", settings=["captures.poses_are=gripper_from_base"])
    assert any(symptom.is_wrong and symptom.cure for symptom in wrong)


def test_threads_share_the_module(cell):
    target = (cell / "target.yaml").read_text()
    images = sorted((cell / "images").iterdir())[:4]
    expected = [heba.detect(image, target).pixels for image in images]
    found = [None] * len(images)

    def detect(i):
        found[i] = heba.detect(images[i], target).pixels

    threads = [threading.Thread(target=detect, args=(i,)) for i in range(len(images))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(a, b) for a, b in zip(found, expected))


def test_the_module_does_not_leak(cell):
    cv2 = pytest.importorskip("cv2")
    grey = cv2.imread(str(sorted((cell / "images").iterdir())[0]), cv2.IMREAD_GRAYSCALE)
    target = (cell / "target.yaml").read_text()

    def peak_mb():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

    for _ in range(15):
        heba.detect(grey, target)
    before = peak_mb()
    for _ in range(80):
        heba.detect(grey, target)
    # 80 leaked images would be 24 MB.
    assert peak_mb() - before < 10


def test_progress_of_a_calibration_is_told_and_can_end_it(cell):
    target = (cell / "target.yaml").read_text()
    names, poses = conftest.read_poses(cell / "poses.csv")
    seen = [heba.detect(cell / "images" / name, target) for name in names]
    told = []
    arguments = {"setup": "eye_to_hand", "image_size": (640, 480)}
    heba.calibrate(seen, poses, target, progress=lambda *step: told.append(step), **arguments)
    assert ("hold-out", 0, 5) in told
    assert told[-1] == ("hold-out", 5, 5)

    class Stop(Exception):
        pass

    def stop(stage, done, total):
        raise Stop

    with pytest.raises(Stop):
        heba.calibrate(seen, poses, target, progress=stop, **arguments)


def test_settings_of_a_symptom_cure_it(cell):
    wrong = "captures.pose_format={columns: [x, y, z, qx, qy, qz, qw], translation: mm, rotation: quaternion_xyzw}"
    symptom = heba.doctor(cell / "config.yaml", settings=[wrong])[0]
    assert symptom.code == "pose_units" and len(symptom.settings) == 1
    assert not [one for one in heba.doctor(cell / "config.yaml", settings=symptom.settings) if one.is_wrong]


def test_settings_cure_a_target_in_a_file_of_its_own(cell, tmp_path):
    shutil.copytree(cell, tmp_path / "cell")
    config = tmp_path / "cell" / "config.yaml"
    assert "target: target.yaml" in config.read_text()
    (config.parent / "target.yaml").write_text("{type: chessboard, rows: 5, columns: 8, square: 30 mm}")
    symptom = heba.doctor(config)[0]
    assert symptom.code == "target"
    result = heba.run(config, settings=symptom.settings, out=tmp_path / "run")
    assert np.abs(result.hand_eye - heba.run(cell / "config.yaml", out=tmp_path / "right").hand_eye).max() < 1e-6


def test_unknown_names_have_suggestions(cell, program_run):
    with pytest.raises(heba.Error, match="did you mean 'park'"):
        heba.Result.read(program_run).estimate("parc")
    with pytest.raises(heba.Error, match="did you mean 'eye_in_hand'"):
        heba.calibrate([], np.zeros((0, 4, 4)), "", setup="eye_on_hand", image_size=(640, 480))
    target = (cell / "target.yaml").read_text()
    seen = [([0], [[1, 2]])] * 3
    with pytest.raises(heba.Error, match="did you mean 'brown5'"):
        camera = ("brwn5", [1] * 9)
        heba.calibrate(seen, [np.eye(4)] * 3, target, setup="eye_in_hand", image_size=(640, 480), camera=camera)


WITHOUT_NUMPY = """
import sys
sys.modules["numpy"] = None  # As if it were not installed.
import heba
result = heba.run(sys.argv[1], out=sys.argv[2])
print(result.verdict["grade"], "bundle" in result.table(), len(heba.methods()) > 5)
calls = [
    ("calibrate", lambda: heba.calibrate([], [], "", setup="eye_to_hand", image_size=(1, 1))),
    ("detect", lambda: heba.detect("x.png", "")),
    ("locate", lambda: heba.locate(result, "x.png")),
    ("calibrate_hand_eye", lambda: heba.calibrate_hand_eye([], [], [], [])),
    ("Result.hand_eye", lambda: result.hand_eye),
    ("Result.covariance", lambda: result.covariance),
]
for name, call in calls:
    try:
        call()
    except ImportError as error:
        assert str(error).startswith(f"heba.{name} needs numpy: ") and "\\n" not in str(error), error
    else:
        raise SystemExit(f"{name} needs no numpy")
"""


def test_runs_need_no_numpy(cell, tmp_path):
    # The package is found where this test finds it.
    environment = {**os.environ, "PYTHONPATH": str(Path(heba.__file__).parents[1])}
    arguments = [sys.executable, "-c", WITHOUT_NUMPY, str(cell / "config.yaml"), str(tmp_path / "run")]
    done = subprocess.run(arguments, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["good", "True", "True"]
