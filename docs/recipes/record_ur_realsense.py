"""Records images of a RealSense camera and the poses of a Universal Robots arm in the form that heba reads.

    python3 record_ur_realsense.py ROBOT_IP FOLDER

Move the arm, let go, press Enter: the script waits until the arm stands, and takes an image. `q` ends. The poses are
those of the active tool, whose offset from the flange is in FOLDER/config.yaml. Needs ur_rtde and pyrealsense2.
"""

import csv
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pyrealsense2 as rs
import rtde_receive

robot = rtde_receive.RTDEReceiveInterface(sys.argv[1])
folder = Path(sys.argv[2])
(folder / "images").mkdir(parents=True)
pipeline, stream = rs.pipeline(), rs.config()
stream.enable_stream(rs.stream.color, 1920, 1080, rs.format.bgr8, 30)
sensor = pipeline.start(stream).get_device().first_color_sensor()
for _ in range(60):  # Exposure and white balance settle, and are then held.
    pipeline.wait_for_frames()
sensor.set_option(rs.option.enable_auto_exposure, 0)
sensor.set_option(rs.option.enable_auto_white_balance, 0)
tool = ", ".join(f"{number:.6g}" for number in robot.getTCPOffset())
(folder / "config.yaml").write_text(
    "setup: eye_in_hand    # or eye_to_hand\n"
    "target: target.yaml   # the file of the printed sheet\n"
    "captures: {images: images, poses: poses.csv, pose_format: ur}\n"
    "# With `robot: {model: ur5e}` and `joints: joints.csv` in captures, the arm's own errors are estimated.\n"
    f"about: {{active tool in the flange (m and rad): '{tool}'}}\n"
)
with open(folder / "poses.csv", "w", newline="") as poses, open(folder / "joints.csv", "w", newline="") as joints:
    csv.writer(poses).writerow(["image", "time", "x", "y", "z", "rx", "ry", "rz"])
    csv.writer(joints).writerow(["image", "j1", "j2", "j3", "j4", "j5", "j6"])
    while input("Enter takes an image, q ends: ") != "q":
        while max(map(abs, robot.getActualQd())) > 1e-3:
            time.sleep(0.1)
        time.sleep(0.5)  # The arm stands, but may still swing.
        for _ in range(5):  # Older frames may show the motion.
            frames = pipeline.wait_for_frames()
        name = f"{len(list((folder / 'images').iterdir())):03}.png"
        cv2.imwrite(str(folder / "images" / name), np.asanyarray(frames.get_color_frame().get_data()))
        csv.writer(poses).writerow([name, time.time(), *robot.getActualTCPPose()])
        csv.writer(joints).writerow([name, *robot.getActualQ()])
        poses.flush(), joints.flush()
