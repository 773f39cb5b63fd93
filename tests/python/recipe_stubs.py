"""Stands in for robots, cameras and ROS, so that the recipes run without them.

    python3 recipe_stubs.py CELL RECIPE [ARGUMENT...]

The arm takes the poses of CELL/poses.csv (form ros) one after the other, and the cameras see CELL/images. Right after
each move the arm is still moving, and the cameras give an image of the move before.
"""

import csv
import runpy
import shutil
import sys
import threading
import time
import types
from pathlib import Path

import numpy as np

CELL = Path(sys.argv[1])
ROWS = list(csv.DictReader(open(CELL / "poses.csv")))
wait = time.sleep


class Cell:
    """Where the arm is, and how often its speed and the camera's images were asked for since it moved."""

    index, asked, images = 0, 0, 0


def speed(joints):
    Cell.asked += 1
    return [0.1 if Cell.asked < 3 else 0.0] * joints


def seen():
    """The number of the image that a camera shows: an old one right after a move."""
    Cell.images += 1
    is_old = Cell.asked < 3 or Cell.images < 3
    return np.array([max(0, Cell.index - 1) if is_old else Cell.index])


def write_image(path, image):
    assert int(image[0]) == Cell.index, f"{path} has an image that was taken before the arm stood"
    shutil.copy(CELL / "images" / ROWS[Cell.index]["image"], path)
    return True


def pose():
    row = ROWS[Cell.index]
    return [float(row[key]) for key in ("x", "y", "z", "qx", "qy", "qz", "qw")]


def matrix():
    x, y, z, qx, qy, qz, qw = pose()
    pose_matrix = np.eye(4)
    pose_matrix[:3, :3] = [
        [1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)],
        [2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)],
        [2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)],
    ]
    pose_matrix[:3, 3] = x, y, z
    return pose_matrix


def rotation_vector():
    vector, scalar = np.array(pose()[3:6]), pose()[6]
    length = np.linalg.norm(vector)
    angle = 2 * np.arctan2(length, scalar)
    return list(vector / length * angle) if length > 0 else [0.0, 0.0, 0.0]


def module(name, **members):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__dict__.update(members)
    return sys.modules[name]


class UrReceive:
    def __init__(self, ip):
        self.getTCPOffset = lambda: [0, 0, 0.1, 0, 0, 0]
        self.getActualQd = lambda: speed(6)
        self.getActualTCPPose = lambda: pose()[:3] + rotation_vector()
        self.getActualQ = lambda: [0.1 * joint for joint in range(6)]


class RealSense:
    """A pipeline, its profile, its device, its sensor, a frame and its colour image at once."""

    options = {}

    def __getattr__(self, name):
        return lambda *arguments: self

    def set_option(self, option, value):
        RealSense.options[option] = value

    def wait_for_frames(self):
        self.image = seen()
        return self

    def get_data(self):
        return self.image


class Panda:
    def __init__(self, ip):
        pass

    def get_state(self):
        return types.SimpleNamespace(
            F_T_EE=np.eye(4).ravel(), O_T_EE=matrix().ravel(order="F"), q=[0.1] * 7, dq=speed(7)
        )


class VideoCapture:
    def __init__(self, number):
        self.set = lambda option, value: True
        self.grab = seen

    def read(self):
        return True, seen()


class Node:
    def __init__(self, name):
        pass

    def declare_parameter(self, name, default):
        given = [word.split(":=")[1] for word in sys.argv if word.startswith(f"{name}:=")]
        return types.SimpleNamespace(value=given[0] if given else default)

    def create_subscription(self, kind, topic, callback, qos):
        Node.callback = callback


class Buffer:
    def lookup_transform(self, target, source, at):
        offset = max(map(abs, speed(1)))
        x, y, z, qx, qy, qz, qw = pose()
        xyz = types.SimpleNamespace(x=x + offset * Cell.asked, y=y, z=z)
        return types.SimpleNamespace(
            transform=types.SimpleNamespace(
                translation=xyz, rotation=types.SimpleNamespace(x=qx, y=qy, z=qz, w=qw)
            )
        )


def spin(node):
    while True:
        stamp = types.SimpleNamespace(sec=1000 + Cell.index, nanosec=5)
        number = Cell.index if Cell.asked >= 3 else max(0, Cell.index - 1)
        message = types.SimpleNamespace(header=types.SimpleNamespace(stamp=stamp), number=number)
        Node.callback(message)
        wait(0.002)


def move_and_ask(answers=iter([""] * len(ROWS) + ["q"]), moves=iter(range(len(ROWS)))):
    """Stands for input(): the arm moves before each Enter."""
    answer = next(answers)
    if answer != "q":
        Cell.index, Cell.asked, Cell.images = next(moves), 0, 0
    return answer


time.sleep = lambda seconds: wait(min(seconds, 0.001))
module("cv2", imwrite=write_image, VideoCapture=VideoCapture, CAP_PROP_AUTOFOCUS=39, CAP_PROP_AUTO_EXPOSURE=21,
       CAP_PROP_AUTO_WB=44)  # fmt: skip
module("rtde_receive", RTDEReceiveInterface=UrReceive)
names = types.SimpleNamespace
module(
    "pyrealsense2",
    pipeline=RealSense,
    config=RealSense,
    stream=names(color=1),
    format=names(bgr8=1),
    option=names(enable_auto_exposure="exposure", enable_auto_white_balance="white balance"),
)
module("panda_py", Panda=Panda)
module("rclpy", init=lambda: None, shutdown=lambda: None, spin=spin)
module("rclpy.node", Node=Node)
module("rclpy.qos", qos_profile_sensor_data=None)
module("rclpy.time", Time=lambda: None)
module("sensor_msgs")
module("sensor_msgs.msg", Image=object)
module("tf2_ros", Buffer=Buffer, TransformListener=lambda buffer, node: None)
module("cv_bridge", CvBridge=lambda: names(imgmsg_to_cv2=lambda message, form: np.array([message.number])))
import builtins  # noqa: E402

builtins.input = lambda prompt="": move_and_ask()
sys.argv = sys.argv[2:]
runpy.run_path(sys.argv[0], run_name="__main__")
if "realsense" in sys.argv[0]:
    assert RealSense.options == {"exposure": 0, "white balance": 0}, "exposure or white balance were not held"
