"""Runs with rigs and location with their results, beside the program's own results."""

import json
import shutil
import subprocess

import conftest
import numpy as np
import pytest

import heba

@pytest.fixture(scope="module")
def rig_run(rig_cell, tmp_path_factory):
    """The folder that `heba run` writes for the cell."""
    out = tmp_path_factory.mktemp("rig_program") / "run"
    conftest.program("run", rig_cell / "config.yaml", "--out", out, "--quiet")
    return out


def without_times(data):
    """Returns the contents of result.json as text, without the times that the work took."""
    data = dict(data)
    del data["timing_s"]
    data["solve"] = {key: value for key, value in data["solve"].items() if key != "seconds"}
    return json.dumps(data)


def seen_by_all(rig_run):
    """Returns the name of a capture in which the fixed cameras see the plate."""
    entries = json.loads((rig_run / "result.json").read_text())["captures"]
    whole = {(entry["camera"], entry["capture"]) for entry in entries if entry["points"] == 35}
    return min(name for camera, name in whole if camera == "left" and ("right", name) in whole)


def test_run_writes_what_the_program_writes(rig_cell, rig_run, tmp_path):
    told = []
    result = heba.run(
        rig_cell / "config.yaml", out=tmp_path / "run", threads=1, progress=lambda *step: told.append(step)
    )
    assert isinstance(result, heba.Result)
    program = json.loads((rig_run / "result.json").read_text())
    assert without_times(result.data) == without_times(program)
    assert {file.name for file in (tmp_path / "run").iterdir()} == {file.name for file in rig_run.iterdir()}
    assert result.verdict == program["verdict"]
    assert "camera right in camera left\n" in result.table()
    assert ("detection", 72, 72) in told and ("hold-out", 5, 5) in told
    assert repr(result) == "<heba.Result 'config': good>"


def test_cameras_are_calibrated_from_arrays(rig_cell, rig_run):
    names, poses = conftest.read_poses(rig_cell / "poses.csv")
    plate = (rig_cell / "plate.target.yaml").read_text()
    seen = {camera: [heba.detect(rig_cell / camera / name, plate) for name in names] for camera in ("left", "right")}
    seen["right"][2] = None
    keys = {"setup": "eye_to_hand", "image_size": (640, 480), "folds": 0}
    result = heba.calibrate(seen, poses, plate, **keys)
    whole = heba.Result.read(rig_run)
    for name in seen:
        apart = result.cameras[name].pose[:3, 3] - whole.cameras[name].pose[:3, 3]
        assert np.linalg.norm(apart) < 3e-3
    assert np.abs(result.relative("left", "right").pose - whole.relative("left", "right").pose).max() < 3e-3
    assert "camera right in camera left" in result.table()
    calls = [
        (r"points\['left'\] has 1 captures", lambda: heba.calibrate({"left": seen["left"][:1]}, poses, plate, **keys)),
        ("did you mean 'left'", lambda: heba.calibrate(seen, poses, plate, camera={"lefd": None}, **keys)),
        (
            "image_size: has no entry of camera right",
            lambda: heba.calibrate(seen, poses, plate, **{**keys, "image_size": {"left": (640, 480)}}),
        ),
    ]
    for words, call in calls:
        with pytest.raises(heba.Error, match=words):
            call()


def test_doctor_examines_rigs(rig_cell):
    assert not [symptom for symptom in heba.doctor(rig_cell / "config.yaml") if symptom.is_wrong]
    symptoms = heba.doctor(rig_cell / "config.yaml", settings=["captures.poses_are=gripper_from_base"])
    assert symptoms[0].is_wrong and symptoms[0].code == "pose_direction"


def test_progress_can_end_a_run(rig_cell, tmp_path):
    class Stop(Exception):
        pass

    def stop(stage, done, total):
        raise Stop

    with pytest.raises(Stop):
        heba.run(rig_cell / "config.yaml", out=tmp_path / "stopped", progress=stop)
    assert not (tmp_path / "stopped").exists()


def test_poses_have_names_and_covariances(rig_cell, rig_run):
    result = heba.Result.read(rig_run)
    truth = json.loads((rig_cell / "truth.json").read_text())
    assert list(result.cameras) == ["left", "right", "wrist"]
    assert list(result.targets) == ["plate", "wall"]
    left = result.cameras["left"]
    assert (left.mount, result.cameras["wrist"].mount, result.targets["plate"].mount) == ("world", "gripper", "gripper")
    assert left.camera["model"] == "brown5"
    for name, group in (("left", "cameras"), ("wrist", "cameras"), ("plate", "targets")):
        placed = getattr(result, group)[name]
        entry = result.data[group][name]["pose"]
        sigmas = entry["std_translation_m"] + entry["std_rotation_rad"]
        assert np.allclose(np.sqrt(np.diag(placed.covariance)), sigmas, rtol=1e-9)
        error = placed.pose[:3, 3] - truth[group][name]["pose"]["translation_m"]
        assert np.linalg.norm(error) < 5 * np.linalg.norm(entry["std_translation_m"])
    arm = result.robots["robot"]
    assert np.array_equal(arm.pose, np.eye(4)) and arm.covariance is None and arm.noise["mm"] > 0
    assert arm.kinematics is None


def test_relative_poses_are_known_in_both_orders(rig_run):
    result = heba.Result.read(rig_run)
    poses = {name: camera.pose for name, camera in result.cameras.items()}
    forth, back = result.relative("left", "right"), result.relative("right", "left")
    assert np.abs(forth.pose - np.linalg.inv(poses["left"]) @ poses["right"]).max() < 1e-12
    assert np.abs(forth.pose @ back.pose - np.eye(4)).max() < 1e-12
    assert np.array_equal(forth.covariance, result.data["relative"][0]["covariance"])
    # Cameras beside each other share the errors of the arm: their pose in each other is better known than in the world.
    assert np.trace(forth.covariance[:3, :3]) < np.trace(result.cameras["right"].covariance[:3, :3])
    # The covariance of the inverse, by samples of small motions on the right of the pose.
    samples = np.random.default_rng(1).multivariate_normal(np.zeros(6), forth.covariance, 20000)
    inverses = np.array([tangent_of(np.linalg.inv(back.pose) @ np.linalg.inv(forth.pose @ motion(x))) for x in samples])
    expected = np.sqrt(np.diag(back.covariance))
    # 20000 samples estimate a sigma to 0.5 %; six times that.
    assert np.allclose(inverses.std(axis=0), expected, rtol=0.03)
    with pytest.raises(heba.Error, match="constant"):
        result.relative("left", "wrist")
    with pytest.raises(heba.Error, match="did you mean 'right'"):
        result.relative("left", "rigth")


def motion(tangent):
    """Returns the pose of a small motion, to first order."""
    x, y, z = tangent[3:]
    pose = np.eye(4)
    pose[:3, :3] += [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    pose[:3, 3] = tangent[:3]
    return pose


def tangent_of(pose):
    skew = (pose[:3, :3] - pose[:3, :3].T) / 2
    return np.array([*pose[:3, 3], skew[2, 1], skew[0, 2], skew[1, 0]])


def test_location_is_that_of_the_program(rig_cell, rig_run):
    name = seen_by_all(rig_run)
    images = {camera: rig_cell / camera / name for camera in ("left", "right")}
    printed = conftest.program("locate", rig_run, *(f"{camera}={image}" for camera, image in images.items()), "--json")
    expected = json.loads(printed.stdout)["targets"][0]
    located = heba.locate(rig_run, images)
    assert [(one.target, one.cameras, one.num_symmetries) for one in located] == [("plate", ("left", "right"), 1)]
    assert np.allclose(located[0].base_from_target[:3, 3], expected["pose"]["translation_m"], rtol=0, atol=1e-12)
    sigmas = np.sqrt(np.diag(located[0].pose_covariance))
    assert np.allclose(1000 * sigmas[:3], expected["sigma"]["total"]["mm"], rtol=1e-9)
    assert np.allclose(np.rad2deg(sigmas[3:]), expected["sigma"]["total"]["deg"], rtol=1e-9)
    assert located[0].rms_px == pytest.approx(expected["rms_px"])
    centre_mm = 1000 * np.sqrt(np.diag(located[0].covariance))
    assert np.allclose(centre_mm, expected["poses"][0]["sigma_in_world"]["total_mm"], rtol=1e-9)
    # The target is where the arm holds it.
    names, poses = conftest.read_poses(rig_cell / "poses.csv")
    held = poses[names.index(name)] @ heba.Result.read(rig_run).targets["plate"].pose
    assert np.linalg.norm(located[0].base_from_target[:3, 3] - held[:3, 3]) < 1e-3
    # Arrays in place of files, and one camera alone, which is less certain.
    cv2 = pytest.importorskip("cv2")
    greys = {camera: cv2.imread(str(image), cv2.IMREAD_GRAYSCALE) for camera, image in images.items()}
    of_arrays = heba.locate(heba.Result.read(rig_run), greys)[0]
    assert np.array_equal(of_arrays.base_from_target, located[0].base_from_target)
    alone = heba.locate(rig_run, {"left": greys["left"]})[0]
    assert alone.cameras == ("left",)
    assert np.trace(alone.pose_covariance[:3, :3]) > np.trace(located[0].pose_covariance[:3, :3])
    with pytest.raises(heba.Error, match="left.*640 x 479.*640 x 480"):
        heba.locate(rig_run, {"left": greys["left"][:-1]})


def test_a_stream_of_poses_serves_several_cameras(rig_cell, tmp_path):
    shutil.copytree(rig_cell, tmp_path / "rig")
    names, _ = conftest.read_poses(rig_cell / "poses.csv")
    numbers = np.array([line.split(",")[1:8] for line in (rig_cell / "poses.csv").read_text().splitlines()[1:]], float)
    # The robot moves from pose to pose within a second, and the cameras' clock is ahead by .3 s.
    signs = np.cumprod(np.sign(np.sum(numbers[1:, 3:] * numbers[:-1, 3:], axis=1)))
    numbers[1:, 3:] *= signs[:, np.newaxis]
    times = np.arange(0, len(names) - 1 + 1e-9, 0.02)
    stream = np.array([np.interp(times, np.arange(len(names)), column) for column in numbers.T]).T
    stream[:, 3:] /= np.linalg.norm(stream[:, 3:], axis=1)[:, np.newaxis]
    rows = ["time,x,y,z,qx,qy,qz,qw"] + [",".join(map(repr, [float(t), *map(float, row)])) for t, row in zip(times, stream)]
    (tmp_path / "rig" / "stream.csv").write_text("\n".join(rows) + "\n")
    rows = ["image,time"] + [f"{name},{i + 0.3}" for i, name in enumerate(names[:-1])]
    (tmp_path / "rig" / "poses.csv").write_text("\n".join(rows) + "\n")
    settings = {"captures.stream": str(tmp_path / "rig" / "stream.csv"), "refine.robot_noise": "white", "evaluate.folds": 0}
    config = tmp_path / "rig" / "config.yaml"
    result = heba.run(config, out=tmp_path / "run", settings=settings)
    assert result.data["time_offset"]["value_s"] == pytest.approx(-0.3, abs=0.002)
    symptoms = heba.doctor(config, settings=settings)
    assert not any(symptom.is_wrong for symptom in symptoms), symptoms


def test_check_takes_the_images_of_several_cameras(rig_cell, rig_run):
    names, poses = conftest.read_poses(rig_cell / "poses.csv")
    images = {camera: [rig_cell / camera / name for name in names[:3]] for camera in ("left", "right")}
    of_images = np.concatenate([poses[:3], poses[:3]])
    check = heba.check(rig_run, images, poses=of_images, target="in-place")
    assert check.decision == "holds", check
    step = np.eye(4)
    step[0, 3] = 0.02
    moved = heba.check(rig_run, {"left": images["left"]}, poses=step @ poses[:3], target="in-place")
    assert moved.decision == "moved" and moved.change["side"] in ("hand", "world")
    with pytest.raises(heba.Error, match="^images: the run is that of a rig; a dictionary by the names of its cameras"):
        heba.check(rig_run, images["left"], poses=poses[:3], target="in-place")
    with pytest.raises(heba.Error, match="^images: 'lift' is unknown; did you mean 'left'"):
        heba.check(rig_run, {"lift": images["left"]}, poses=poses[:3], target="in-place")


def test_a_carried_camera_needs_the_pose_of_its_arm(rig_cell, rig_run):
    names, poses = conftest.read_poses(rig_cell / "poses.csv")
    image = rig_cell / "wrist" / names[0]
    located = heba.locate(rig_run, {"wrist": image}, pose=poses[0])[0]
    held = poses[0] @ heba.Result.read(rig_run).targets["plate"].pose
    assert np.linalg.norm(located.base_from_target[:3, 3] - held[:3, 3]) < 1e-3
    by_name = heba.locate(rig_run, {"wrist": image}, pose={"robot": poses[0]})[0]
    assert np.array_equal(by_name.base_from_target, located.base_from_target)
    with pytest.raises(heba.Error, match="camera wrist is carried by the arm robot, whose pose is needed"):
        heba.locate(rig_run, {"wrist": image})
    with pytest.raises(heba.Error, match="the arm robot carries none of the cameras"):
        heba.locate(rig_run, {"left": rig_cell / "left" / names[0]}, pose=poses[0])
    with pytest.raises(heba.Error, match="did you mean 'robot'"):
        heba.locate(rig_run, {"wrist": image}, pose={"robt": poses[0]})


def test_images_that_contradict_each_other_are_refused(rig_cell, rig_run):
    first = seen_by_all(rig_run)
    names = [name for name, _ in zip(*conftest.read_poses(rig_cell / "poses.csv")) if name != first]
    right = heba.locate(rig_run, {camera: rig_cell / camera / first for camera in ("left", "right")})
    assert right[0].chance > 1e-3
    assert heba.locate(rig_run, {"left": rig_cell / "left" / first})[0].chance == 1
    num_refused = 0
    for other in names:
        images = {"left": rig_cell / "left" / first, "right": rig_cell / "right" / other}
        if len(heba.detect(images["right"], (rig_cell / "plate.target.yaml").read_text())) < 35:
            continue
        num_refused += 1
        with pytest.raises(heba.Error, match="target plate: the cameras left, right contradict each other"):
            heba.locate(rig_run, images)
    assert num_refused > 0


def test_the_errors_of_an_arm_correct_its_poses(tmp_path):
    (tmp_path / "scene.yaml").write_text(conftest.RIG_SCENE)
    robot = "{model: ur10e, offsets: 0.05 deg, lengths: 0.3 mm, angles: 0.03 deg, configurations: several}"
    changes = (f"robot={robot}", "motion.captures=20", "robot_noise={translation: 0.02 mm, rotation: 0.004 deg}")
    settings = [word for change in changes for word in ("--set", change)]
    cell, run = tmp_path / "cell", tmp_path / "run"
    conftest.program("simulate", tmp_path / "scene.yaml", "--out", cell, "--quiet", *settings)
    conftest.program("run", cell / "config.yaml", "--out", run, "--quiet", "--set", "evaluate.folds=0")
    kinematics = heba.Result.read(run).robots["robot"].kinematics
    assert (kinematics["model"], kinematics["decision"]) == ("ur10e", "estimated")
    names, poses = conftest.read_poses(cell / "poses.csv")
    row = next(line for line in (cell / "joints.csv").read_text().splitlines() if line.startswith(names[0]))
    joints = [float(number) for number in row.split(",")[1:]]
    stated = next(line for line in (cell / "poses.csv").read_text().splitlines() if line.startswith(names[0]))
    image = cell / "wrist" / names[0]
    printed = conftest.program(
        "locate", run, f"wrist={image}", f"--pose={stated.split(',', 1)[1]}", f"--joints={row.split(',', 1)[1]}", "--json"
    )
    expected = json.loads(printed.stdout)
    located = heba.locate(run, {"wrist": image}, pose=poses[0], joints=joints)
    assert [one.target for one in located] == [target["target"] for target in expected["targets"]]
    for one, target in zip(located, expected["targets"]):
        assert np.allclose(one.base_from_target[:3, 3], target["pose"]["translation_m"], rtol=0, atol=1e-9)
        sigmas_mm = 1000 * np.sqrt(np.diag(one.pose_covariance)[:3])
        assert np.allclose(sigmas_mm, target["sigma"]["total"]["mm"], rtol=1e-6)
    by_name = heba.locate(run, {"wrist": image}, pose={"robot": poses[0]}, joints={"robot": joints})
    assert np.array_equal(by_name[0].base_from_target, located[0].base_from_target)
    with pytest.raises(heba.Error, match="pose: arm robot: .* several configurations.*; joints, those of the arm"):
        heba.locate(run, {"wrist": image}, pose=poses[0])
    with pytest.raises(heba.Error, match="joints: arm robot: there are 2, but the arm ur10e has 6"):
        heba.locate(run, {"wrist": image}, pose=poses[0], joints=[0, 0])
    check_corrected_poses(cell, run, tmp_path)


def check_corrected_poses(cell, run, folder):
    """Checks that the poses of a run are corrected as the program corrects them."""
    rows = [line.split(",") for line in (cell / "poses.csv").read_text().splitlines() if not line.startswith("#")]
    joints = {}
    for line in (cell / "joints.csv").read_text().splitlines():
        name, *positions = line.split(",")
        joints[name] = positions
    lines = [",".join(row + joints[row[0]]) for row in rows if row[0] in joints]
    (folder / "with_joints.csv").write_text("\n".join(lines) + "\n")
    names, poses = conftest.read_poses(folder / "with_joints.csv")
    at = [[float(number) for number in joints[name]] for name in names]
    result = heba.Result.read(run)
    for options, inverse in ((["--inverse"], True), ([], False)):
        conftest.program("correct", run, folder / "with_joints.csv", "--out", folder / "corrected.csv", *options)
        of_names, expected = conftest.read_poses(folder / "corrected.csv")
        assert of_names == names
        corrected = result.correct(poses, at, inverse=inverse)
        assert np.allclose(corrected, expected, rtol=0, atol=1e-8)
        assert np.abs(corrected - poses).max() > 1e-5
    with pytest.raises(heba.Error, match=r"poses\[0\]: .*several configurations"):
        result.correct(poses)
    with pytest.raises(heba.Error, match="joints: the arm ur10e has 6 joints, not 2"):
        result.correct(poses[:1], [[0, 0]])
    with pytest.raises(heba.Error, match="arm: unknown .*robot|arm: .*did you mean 'robot'"):
        result.correct(poses[:1], arm="robt")


def test_wrong_input_is_one_line(rig_cell, rig_run, program_run, cell, tmp_path):
    image = rig_cell / "left" / seen_by_all(rig_run)
    calls = [
        ("dictionary of images", lambda: heba.locate(rig_run, image)),
        ("one image is needed", lambda: heba.locate(program_run, {"left": image})),
        ("did you mean 'left'", lambda: heba.locate(rig_run, {"lefd": image})),
        ("joints", lambda: heba.locate(rig_run, {"left": image}, joints=[0])),
        ("their poses are in Result.cameras", lambda: heba.Result.read(rig_run).hand_eye),
        ("their poses are in Result.targets", lambda: heba.Result.read(rig_run).board),
        ("it has one estimate", lambda: heba.Result.read(rig_run).estimate()),
        ("no target was detected", lambda: heba.locate(rig_run, {"left": np.zeros((480, 640), np.uint8)})),
    ]
    for words, call in calls:
        with pytest.raises(heba.Error, match=words) as raised:
            call()
        assert "\n" not in str(raised.value)
    # The line of a config's fault is the program's.
    config = rig_cell / "wrong.yaml"
    config.write_text((rig_cell / "config.yaml").read_text().replace("mount: gripper", "mount: griper", 1))
    with pytest.raises(subprocess.CalledProcessError) as ended:
        conftest.program("run", config, "--out", tmp_path / "wrong", "--quiet")
    with pytest.raises(heba.Error) as raised:
        heba.run(config, out=tmp_path / "wrong")
    assert "".join(ended.value.stderr.split()) == "".join(f"heba: error: {raised.value}".split())
    assert not (tmp_path / "wrong").exists()
