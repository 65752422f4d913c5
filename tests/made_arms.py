"""An arm whose rows differ from its controller's, looking at boards and at holes."""

import numpy as np
from made_sessions import MOUNTED, World
from scipy.spatial.transform import Rotation

from cell.core.geometry import Transform
from cell.core.kinematics import arm_for
from cell.metrology.calibrate.board_pose import locate_boards
from cell.metrology.calibrate.hand_eye.solve import HandEyeProblem, HandEyeView, solve_hand_eye
from cell.metrology.calibrate.kinematics import JointView, with_rows
from cell.metrology.motions import lay_onto

RESTING = np.radians([137.0, -90.0, 100.0, 0.0, 60.0, 150.0])
OFF = np.repeat([0.1, 0.1, np.radians(0.02), np.radians(0.01)], 6)
JOINT_NOISE = np.radians(0.003)
HOLES = np.array([[x, y, z] for x in (850.0, 1000.0) for y in (-400.0, 0.0, 400.0)
                  for z in (100.0, 400.0, 600.0)])


class ArmWorld:
    """Fifteen views of each of three boards by a UR10e `off` by 0.1 mm and 0.02 degrees."""

    def __init__(self, seed, off=1.0, boards=3, each=15):
        self._rng = np.random.default_rng(seed)
        self.nominal, self.mounted = arm_for("ur10e"), MOUNTED
        self.true = with_rows(self.nominal, self._rng.normal(0.0, 1.0, 24) * OFF * off)
        self._world = World()
        self.views = [view for index in range(boards)
                      for view in self._look_at(f"board {index}", each)]

    def hand_eye(self):
        """Solve the mount as usual: the controller's rows taken as true, one board."""
        views = [view for view in self.views if view.board_id == "board 0"]
        return solve_hand_eye(HandEyeProblem(tuple(
            HandEyeView(self.nominal.forward(view.joints), view.board)
            for view in views))).carrier_from_camera

    def holes_missed_by(self, arm, flange_from_camera):
        """How far (mm, rms) holes are missed by after the body has been laid on by best fit."""
        rng, found, holes = np.random.default_rng(77), [], []
        for hole in HOLES:
            joints = self._over(hole, rng)
            if joints is None:
                continue
            noisy = np.array(joints) + rng.normal(0.0, JOINT_NOISE, 6)
            in_camera = (self.true.forward(noisy) @ self.mounted).inverse @ hole
            found.append(arm.forward(joints) @ flange_from_camera @ in_camera)
            holes.append(hole)
        found, holes = np.array(found), np.array(holes)
        gap = lay_onto(found, holes) @ found - holes
        return float(np.sqrt(np.mean(np.sum(gap ** 2, axis=1))))

    def _look_at(self, name, count):
        lean = Rotation.from_euler("xyz", [180 + self._rng.uniform(-15, 15),
                                           *self._rng.uniform(-15, 15, 2)], degrees=True)
        place = Transform.from_parts(lean.as_matrix(), [self._rng.uniform(500, 800),
                                                        self._rng.uniform(-450, 250),
                                                        self._rng.uniform(0, 400)])
        while count:
            view = self._view(name, place)
            if view is not None:
                count -= 1
                yield view

    def _view(self, name, base_from_board):
        wanted = base_from_board @ self._world.board_poses(1, self._rng)[0].inverse
        joints = self.nominal.closest(wanted @ self.mounted.inverse, RESTING)
        if joints is None:
            return None
        noisy = np.array(joints) + self._rng.normal(0.0, JOINT_NOISE, 6)
        camera_from_board = ((self.true.forward(noisy) @ self.mounted).inverse @ base_from_board)
        seen = self._world._seen(camera_from_board, self._rng)
        return JointView(joints, locate_boards([seen], self._world.camera)[0], name)

    def _over(self, hole, rng):
        for _ in range(20):
            lean = Rotation.from_euler("xyz", [90 + rng.uniform(-15, 15), rng.uniform(-15, 15),
                                               90 + rng.uniform(-15, 15)], degrees=True).as_matrix()
            stand = Transform.from_parts(lean, hole - lean @ [0.0, 0.0, 250.0])
            joints = self.nominal.closest(stand @ self.mounted.inverse, RESTING)
            if joints is not None:
                return joints
        return None


FACE = [(u, v) for u in (-1.0, 0.0, 1.0) for v in (-1.0, 0.0, 1.0)]
FACES = [*[(0.0, 0.0, 1.0, u, v, 1.0) for u, v in FACE],
         *[(-1.0, 0.0, 0.0, -1.0, u, v) for u, v in FACE],
         *[(0.0, 1.0, 0.0, u, 1.0, v) for u, v in FACE]]
"""Outward normal and place on a box of half-width one: 27 holes on three of its faces."""
BOX_MIDDLE, BOX_HALF = np.array([820.0, -100.0, 250.0]), np.array([250.0, 450.0, 175.0])
DATUMS = [0, 2, 6, 9, 15, 20, 26]  # at the ends of the three faces


class StudyWorld(ArmWorld):
    """The study that the figures come from: ten views of each of five boards; 27 holes on three
    faces of a body of 0.5 x 0.9 x 0.35 m, laid on by best fit over 7 and judged at the other 20.

    It does not say where body and boards stand, which three faces, which datums: here a body
    before the robot, its top, its near and its left face, datums at the ends; boards as in
    `ArmWorld`; holes looked at from 250 mm within 15 degrees of the face's normal, any roll.
    """

    def __init__(self, seed, boards=5, each=10):
        super().__init__(seed, boards=boards, each=each)
        self._looks = [self._look(np.array(face)) for face in FACES]

    def holes_missed_by(self, arm, flange_from_camera):
        """How far (mm, rms) the twenty holes are missed by."""
        found = np.array([arm.forward(joints) @ flange_from_camera @ in_camera
                          for joints, in_camera, _ in self._looks])
        holes = np.array([hole for *_, hole in self._looks])
        gap = lay_onto(found[DATUMS], holes[DATUMS]) @ found - holes
        judged = np.delete(gap, DATUMS, axis=0)
        return float(np.sqrt(np.mean(np.sum(judged ** 2, axis=1))))

    def point_error(self, flange_from_camera):
        """How far (mm, rms) the working volume is carried wrongly."""
        return self._world.point_error(flange_from_camera)

    def _look(self, face):
        normal, hole = face[:3], BOX_MIDDLE + face[3:] * BOX_HALF
        onto = Rotation.align_vectors([-normal], [[0.0, 0.0, 1.0]])[0]
        for _ in range(500):
            lean = Rotation.from_euler("xyz", [*self._rng.uniform(-15, 15, 2),
                                               self._rng.uniform(-180, 180)], degrees=True)
            turn = (onto * lean).as_matrix()
            stand = Transform.from_parts(turn, hole - turn @ [0.0, 0.0, 250.0])
            joints = self.nominal.closest(stand @ self.mounted.inverse, RESTING)
            if joints is not None:
                noisy = np.array(joints) + self._rng.normal(0.0, JOINT_NOISE, 6)
                return joints, (self.true.forward(noisy) @ self.mounted).inverse @ hole, hole
        raise AssertionError(f"the hole at {hole} is out of reach")
