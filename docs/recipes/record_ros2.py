"""Records an image topic and the pose of the gripper by tf2 in the form that heba reads: a ROS 2 node.

    python3 record_ros2.py --ros-args -p image:=/camera/image_raw -p base:=base_link -p gripper:=tool0 -p folder:=cell

Move the arm, press Enter: the node waits until the arm stands, and takes the next image. `q` ends. Hold the focus,
the exposure and the white balance of the camera by the parameters of its driver. Needs rclpy, tf2_ros and cv_bridge.
"""

import csv
import threading
import time
from pathlib import Path

import cv2
import rclpy
from cv_bridge import CvBridge
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import Image
from tf2_ros import Buffer, TransformListener


class Recorder(Node):
    def __init__(self):
        super().__init__("heba_recorder")
        names = {"image": "/camera/image_raw", "base": "base_link", "gripper": "tool0", "folder": "cell"}
        self.names = {name: self.declare_parameter(name, default).value for name, default in names.items()}
        self.transforms = Buffer()
        self.listener = TransformListener(self.transforms, self)
        self.image = None
        self.create_subscription(Image, self.names["image"], self.keep, qos_profile_sensor_data)

    def keep(self, image):
        self.image = image

    def pose(self):
        """base_from_gripper now: x, y, z, qx, qy, qz, qw."""
        at = self.transforms.lookup_transform(self.names["base"], self.names["gripper"], Time()).transform
        position, rotation = at.translation, at.rotation
        return [position.x, position.y, position.z, rotation.x, rotation.y, rotation.z, rotation.w]

    def standing_pose(self):
        pose, last = self.pose(), None
        while last is None or max(abs(a - b) for a, b in zip(pose, last)) > 1e-4:
            time.sleep(0.5)
            pose, last = self.pose(), pose
        return pose


rclpy.init()
node = Recorder()
threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
folder = Path(node.names["folder"])
(folder / "images").mkdir(parents=True)
(folder / "config.yaml").write_text(
    "setup: eye_in_hand    # or eye_to_hand\n"
    "target: target.yaml   # the file of the printed sheet\n"
    "captures: {images: images, poses: poses.csv, pose_format: ros}\n"
    f"about: {{gripper: '{node.names['gripper']} in {node.names['base']}'}}\n"
)
with open(folder / "poses.csv", "w", newline="") as file:
    table = csv.writer(file)
    table.writerow(["image", "time", "x", "y", "z", "qx", "qy", "qz", "qw"])
    while input("Enter takes an image, q ends: ") != "q":
        pose = node.standing_pose()
        node.image = None  # An older image may show the motion.
        while node.image is None:
            time.sleep(0.02)
        stamp = node.image.header.stamp
        name = f"{len(list((folder / 'images').iterdir())):03}.png"
        cv2.imwrite(str(folder / "images" / name), CvBridge().imgmsg_to_cv2(node.image, "bgr8"))
        table.writerow([name, stamp.sec + 1e-9 * stamp.nanosec, *pose])
        file.flush()
rclpy.shutdown()
