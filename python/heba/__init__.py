"""Hand-eye calibration by bundle adjustment.

Poses are 4 x 4 matrices, named by their frames: `base_from_camera` maps coordinates of the camera's frame to the robot's
base. Lengths are in metres, angles in radians, pixels with (0, 0) at the centre of the first one. The camera frame is
the optical one (x right, y down, z forward).

>>> import heba
>>> result = heba.run("cell.yaml")
>>> print(result.verdict["grade"], result.hand_eye)
"""

from ._calibration import Detection, Location, Symptom, calibrate, detect, doctor, locate, run
from ._comparison import Comparison, compare
from ._heba import Error, __version__
from ._opencv import (
    CALIB_HAND_EYE_ANDREFF,
    CALIB_HAND_EYE_DANIILIDIS,
    CALIB_HAND_EYE_HORAUD,
    CALIB_HAND_EYE_PARK,
    CALIB_HAND_EYE_TSAI,
    CALIB_ROBOT_WORLD_HAND_EYE_LI,
    CALIB_ROBOT_WORLD_HAND_EYE_SHAH,
    calibrate_hand_eye,
    calibrate_robot_world_hand_eye,
    calibrateHandEye,
    calibrateRobotWorldHandEye,
    methods,
)
from ._result import ArmResult, CameraResult, RelativePose, Result, TargetResult
from ._sessions import Check, Plan, check, init, plan, simulate
from ._sheets import target
from ._study import Study, study

__all__ = [
    "CALIB_HAND_EYE_ANDREFF",
    "CALIB_HAND_EYE_DANIILIDIS",
    "CALIB_HAND_EYE_HORAUD",
    "CALIB_HAND_EYE_PARK",
    "CALIB_HAND_EYE_TSAI",
    "CALIB_ROBOT_WORLD_HAND_EYE_LI",
    "CALIB_ROBOT_WORLD_HAND_EYE_SHAH",
    "ArmResult",
    "CameraResult",
    "Check",
    "Comparison",
    "Detection",
    "Error",
    "Location",
    "Plan",
    "RelativePose",
    "Result",
    "Study",
    "Symptom",
    "TargetResult",
    "__version__",
    "calibrate",
    "calibrateHandEye",
    "calibrateRobotWorldHandEye",
    "calibrate_hand_eye",
    "calibrate_robot_world_hand_eye",
    "check",
    "compare",
    "detect",
    "doctor",
    "init",
    "locate",
    "methods",
    "plan",
    "run",
    "simulate",
    "study",
    "target",
]
