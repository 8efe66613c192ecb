"""Run by CI with the wheel and its extra `hardware`, from outside the repository."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import rtde_control
import rtde_receive

from marl_airhockey.hardware.lab.emulated_robot import EmulatedRobot

ADDRESS = "127.0.0.29"
airhockey = Path(sys.executable).with_name("airhockey")
command = [airhockey, "ur-emulator", "--address", ADDRESS]
with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as emulator:
    try:
        line = emulator.stdout.readline()
        assert ADDRESS in line, line
        control = rtde_control.RTDEControlInterface(ADDRESS, 125.0)
        receive = rtde_receive.RTDEReceiveInterface(ADDRESS, 125.0)
        pose = receive.getActualTCPPose()
        pose[2] += 0.02
        assert control.moveL(pose, 0.1, 0.5)
        assert abs(receive.getActualTCPPose()[2] - pose[2]) < 0.001
        control.disconnect()
    finally:
        emulator.terminate()
robot = EmulatedRobot()
robot.enable()
for _ in range(20):
    robot.send_action(np.array([0.0, 0.3]))
    robot.advance(0.05)
assert abs(robot.true_velocity[1] - 0.3) < 0.01
print("the emulator works")
