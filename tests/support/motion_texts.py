"""Small motion files as texts."""

import numpy as np

# A root, a bone up, and from its end a bone to the side whose own axes are turned by 90 degrees about z.
ASF = """# made by hand
:version 1.10
:units
  mass 1.0
  length 0.5
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name spine
    direction 0 3 0
    length 2
    axis 0 0 0 XYZ
    dof rz
    limits (-10 10)
  end
  begin
    id 2
    name arm
    direction 1 0 0
    length 1
    axis 0 0 90 XYZ
    dof rx ry
    limits (-10 10)
           (-20 20)
  end
:hierarchy
  begin
    root spine
    spine arm
  end
"""


AMC = """#!made by hand
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 0 0 0
spine 0
arm 0 0
2
root 0 0 0 0 0 90
spine 0
arm 0 0
3
root 0 0 0 90 90 0
spine 0
arm 0 0
4
root 0 0 0 0 0 0
spine 90
arm 0 0
5
root 0 0 0 0 0 0
spine 0
arm 90 0
"""


BVH = """HIERARCHY
ROOT hip
{
  OFFSET 5 5 5
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT knee
  {
    OFFSET 0 2 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 1 0 0
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.04
1 2 3 0 0 0 0 0 0
0 0 0 90 90 0 0 0 0
0 0 0 0 0 0 0 0 90
"""


def is_valid(motion):
    frames, joints = motion.positions.shape[:2]
    assert frames >= 1
    assert motion.rest.shape == (joints, 3)
    assert len(motion.names) == len(set(motion.names)) == len(motion.parents) == joints
    assert all(parent < child for child, parent in enumerate(motion.parents))
    assert np.isfinite(motion.positions).all()
    assert np.isfinite(motion.rest).all()
    assert motion.fps > 0
