"""Records images of a camera that OpenCV reads and the poses of a Franka arm in the form that heba reads.

    python3 record_franka_opencv.py ROBOT_IP CAMERA_NUMBER FOLDER

Guide the arm by hand, let go, press Enter: the script waits until the arm stands, and takes an image. `q` ends. The
poses are those of the end effector that Desk states (O_T_EE). Needs panda_py and opencv-python.
"""

import csv
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import panda_py

robot = panda_py.Panda(sys.argv[1])
camera = cv2.VideoCapture(int(sys.argv[2]))
for option, value in ((cv2.CAP_PROP_AUTOFOCUS, 0), (cv2.CAP_PROP_AUTO_EXPOSURE, 1), (cv2.CAP_PROP_AUTO_WB, 0)):
    camera.set(option, value)  # Focus, exposure and white balance are held.
folder = Path(sys.argv[3])
(folder / "images").mkdir(parents=True)
flange_from_tool = ", ".join(f"{number:.6g}" for number in robot.get_state().F_T_EE)
(folder / "config.yaml").write_text(
    "setup: eye_in_hand    # or eye_to_hand\n"
    "target: target.yaml   # the file of the printed sheet\n"
    "captures: {images: images, poses: poses.csv, pose_format: matrix}\n"
    "# With `robot: {model: franka_fr3}` and `joints: joints.csv` in captures, the arm's own errors are estimated.\n"
    f"about: {{F_T_EE by columns (m): '{flange_from_tool}'}}\n"
)
numbers = [f"m{row}{column}" for row in range(4) for column in range(4)]
with open(folder / "poses.csv", "w", newline="") as poses, open(folder / "joints.csv", "w", newline="") as joints:
    csv.writer(poses).writerow(["image", "time", *numbers])
    csv.writer(joints).writerow(["image", *(f"j{joint}" for joint in range(1, 8))])
    while input("Enter takes an image, q ends: ") != "q":
        while max(map(abs, robot.get_state().dq)) > 1e-3:
            time.sleep(0.1)
        time.sleep(0.5)  # The arm stands, but may still swing.
        for _ in range(5):  # The driver keeps older images.
            camera.grab()
        is_read, image = camera.read()
        if not is_read:
            sys.exit("the camera gives no image")
        name = f"{len(list((folder / 'images').iterdir())):03}.png"
        cv2.imwrite(str(folder / "images" / name), image)
        state = robot.get_state()
        base_from_tool = np.reshape(state.O_T_EE, (4, 4), order="F")
        csv.writer(poses).writerow([name, time.time(), *base_from_tool.ravel()])
        csv.writer(joints).writerow([name, *state.q])
        poses.flush(), joints.flush()
