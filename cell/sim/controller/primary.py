"""The primary interface, port 30001, as far as a client asks it who the arm is: its kinematics.

One robot-state message (type 16) with one sub-package (type 5, kinematics information): a checksum
a joint, the Denavit-Hartenberg rows in m and rad, the calibration's status.
"""

from __future__ import annotations

import struct
import zlib

from cell.sim.controller.arm import EmulatedArm

ROBOT_STATE, KINEMATICS, LINEARISED = 16, 5, 2


def kinematics_message(arm: EmulatedArm) -> bytes:
    """Pack the message that tells a client the arm's kinematics."""
    rows = [struct.pack(">6d", *row) for row in arm.denavit_hartenberg()]
    checksums = [zlib.crc32(b"".join(row[8 * joint:8 * joint + 8] for row in rows))
                 for joint in range(6)]
    content = struct.pack(">6I", *checksums) + b"".join(rows) + struct.pack(">I", LINEARISED)
    inner = struct.pack(">iB", 5 + len(content), KINEMATICS) + content
    return struct.pack(">iB", 5 + len(inner), ROBOT_STATE) + inner
