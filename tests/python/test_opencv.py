"""The functions with OpenCV's arguments, beside OpenCV's own."""

import conftest
import numpy as np
import pytest

import heba


def exact_pairs(num_pairs, seed=1):
    """Returns X = gripper_from_camera and exact poses of the gripper in the base and of the target in the camera."""
    rng = np.random.default_rng(seed)

    def pose(size):
        axis = rng.normal(size=3)
        rotation = np.eye(4)
        quaternion = np.append(np.sin(size / 2) * axis / np.linalg.norm(axis), np.cos(size / 2))
        rotation = conftest.matrices([np.append(rng.uniform(-0.5, 0.5, 3), quaternion)])[0]
        return rotation

    gripper_from_camera = pose(0.7)
    base_from_target = pose(2.0)
    base_from_gripper = np.array([pose(1.0) for _ in range(num_pairs)])
    camera_from_target = np.array(
        [np.linalg.inv(gripper_from_camera) @ np.linalg.inv(pose_) @ base_from_target for pose_ in base_from_gripper]
    )
    return gripper_from_camera, base_from_target, base_from_gripper, camera_from_target


def split(poses):
    return [pose[:3, :3] for pose in poses], [pose[:3, 3:] for pose in poses]


GENERAL = [name for name in heba.methods() if not name.startswith("two_step")]


@pytest.mark.parametrize("method", GENERAL)
def test_exact_poses(method):
    expected, _, grippers, targets = exact_pairs(12)
    rotation, translation = heba.calibrate_hand_eye(*split(grippers), *split(targets), method=method)
    assert rotation.shape == (3, 3) and translation.shape == (3, 1)
    assert np.abs(rotation - expected[:3, :3]).max() < 1e-6
    assert np.abs(translation[:, 0] - expected[:3, 3]).max() < 1e-6


def test_mixed_units_are_warned_of():
    _, _, grippers, targets = exact_pairs(12)
    grippers = grippers.copy()
    grippers[:, :3, 3] *= 1000
    with pytest.warns(UserWarning, match="the robot moves [0-9]+ times as far"):
        heba.calibrate_hand_eye(*split(grippers), *split(targets), method="park")


def test_world_of_exact_poses():
    gripper_from_camera, base_from_target, grippers, targets = exact_pairs(12)
    for method in ("best", "shah", "li", heba.CALIB_ROBOT_WORLD_HAND_EYE_LI):
        found = heba.calibrate_robot_world_hand_eye(*split(targets), *split(np.linalg.inv(grippers)), method)
        expected = [np.linalg.inv(base_from_target), np.linalg.inv(gripper_from_camera)]
        for part, (rotation, translation) in zip(expected, (found[:2], found[2:])):
            assert np.abs(rotation - part[:3, :3]).max() < 1e-6
            assert np.abs(translation[:, 0] - part[:3, 3]).max() < 1e-6


def test_rotation_vectors_millimetres_and_outputs():
    cv2 = pytest.importorskip("cv2")
    expected, _, grippers, targets = exact_pairs(12)
    vectors = [cv2.Rodrigues(pose[:3, :3])[0] for pose in targets]
    mm = 1000.0
    output = np.zeros((3, 3)), np.zeros(3)
    rotation, translation = heba.calibrateHandEye(
        [pose[:3, :3] for pose in grippers],
        [mm * pose[:3, 3] for pose in grippers],
        vectors,
        [mm * pose[:3, 3] for pose in targets],
        *output,
        method=heba.CALIB_HAND_EYE_PARK,
    )
    assert np.abs(translation[:, 0] / mm - expected[:3, 3]).max() < 1e-6
    assert np.array_equal(output[0], rotation) and np.array_equal(output[1], translation[:, 0])


def test_wrong_arguments_have_one_line():
    _, _, grippers, targets = exact_pairs(6)
    wrong = [
        ((*split(grippers[1:]), *split(targets)), {}, "5 poses of the robot, but 6"),
        ((*split(grippers), *split(targets)), {"method": "tsay"}, "'tsay' is unknown.*tsai"),
        ((*split(grippers), *split(targets)), {"method": 7}, "CALIB_HAND_EYE"),
        ((*split(np.nan * grippers), *split(targets)), {}, r"R_gripper2base\[0\]: .*not finite"),
        ((*split(2 * grippers), *split(targets)), {}, r"R_gripper2base\[0\]: is no rotation"),
        ((*split(grippers[:1]), *split(targets[:1])), {}, "captures|poses"),
        (([], [], [], []), {}, "captures|poses"),
    ]
    for arguments, options, text in wrong:
        with pytest.raises(heba.Error, match=text) as error:
            heba.calibrate_hand_eye(*arguments, **options)
        assert "\n" not in str(error.value)


def scatter(grippers, targets, camera):
    """Returns the RMS of the target's position about its mean in the frame in which it is fixed, mm."""
    positions = (grippers @ camera @ targets)[:, :3, 3]
    return 1000 * np.sqrt(((positions - positions.mean(axis=0)) ** 2).sum(axis=1).mean())


def as_pose(rotation, translation):
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = np.ravel(translation)
    return pose


def test_recorded_poses_beside_opencv():
    cv2 = pytest.importorskip("cv2")
    base_from_gripper, camera_from_target = conftest.recorded_pairs("moveit_pose_pairs")
    # The camera is stationary.
    grippers = np.linalg.inv(base_from_gripper)
    arguments = (*split(grippers), *split(camera_from_target))
    ours = {
        name: scatter(grippers, camera_from_target, as_pose(*heba.calibrate_hand_eye(*arguments, method=name)))
        for name in ("best", "tsai", "park", "horaud", "andreff", "daniilidis")
    }
    assert max(ours.values()) < 6, ours
    assert ours["best"] <= 1.01 * min(ours.values()), ours
    # OpenCV 4.6 returns a wrong pose without a word for three of its methods; newer versions may be right.
    theirs = as_pose(*cv2.calibrateHandEye(*arguments, method=cv2.CALIB_HAND_EYE_PARK))
    assert ours["best"] <= 1.01 * scatter(grippers, camera_from_target, theirs)
