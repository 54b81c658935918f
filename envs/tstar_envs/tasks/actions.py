"""What the entries of an action are: joint velocities, the gripper, and whether to connect; each in [-1, 1]."""

from tstar_envs.robots import sawyer

NUM_ACTIONS = sawyer.NUM_JOINTS + 2
GRIPPER, CONNECT = sawyer.NUM_JOINTS, sawyer.NUM_JOINTS + 1
