"""Hand-eye sessions with a known truth, for tests: a robot, a camera, a board, and noise."""

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from cell.core.geometry import Transform
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_pose import (
    BoardPose,
    BoardView,
    locate_boards,
    pose_information,
)
from cell.metrology.calibrate.hand_eye.session import HandEyeSession
from cell.metrology.calibrate.hand_eye.solve import HandEyeProblem, HandEyeView, RobotNoise
from cell.metrology.calibrate.hand_eye.start import solve_park
from cell.metrology.calibrate.pose_planning import plan_views
from cell.metrology.calibrate.working_volume import VOLUME
from cell.metrology.motions import nudge, stack

WIDE = CameraModel((2448, 2048), np.array([[3478.0, 0.0, 1231.0], [0.0, 3479.0, 1017.0],
                                           [0.0, 0.0, 1.0]]),
                   np.array([-0.08, 0.05, 4e-4, -3e-4, 0.0]))
SMALL = CameraModel((768, 576), np.array([[1620.0, 0.0, 391.0], [0.0, 1621.0, 279.0],
                                          [0.0, 0.0, 1.0]]),
                    np.array([-0.06, 0.08, 3e-4, -2e-4, 0.0]))
MOUNTED = Transform.from_parts([0.3, -0.2, 1.9], [31.0, -74.0, 118.0])
BOARD = Transform.from_parts([0.15, 3.05, 0.2], [640.0, -210.0, 95.0])
WORKING_DISTANCE = 250.0


def recorded_sessions():
    """Find the recorded sessions of real robots, or skip with the reason."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("CELL_TEST_DATA", beside)) / "hand-eye"
    if not folder.is_dir():
        pytest.skip(f"no recorded sessions at {folder}: set CELL_TEST_DATA")
    return folder


def board(columns=11, rows=8, square=10.0):
    """The inner corners (n, 3) of a board, mm, z = 0; the origin is a corner."""
    x, y = np.meshgrid(np.arange(columns) * square, np.arange(rows) * square)
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)


@dataclass(frozen=True)
class World:
    """What is true, and how badly it is seen."""

    camera: CameraModel = WIDE
    corners: np.ndarray = field(default_factory=board)
    mount: str = "flange"
    carrier_from_camera: Transform = MOUNTED
    reference_from_board: Transform = BOARD
    noise_mm: float = 0.05
    noise_deg: float = 0.01
    noise_px: float = 0.1
    cone_deg: float = 30.0
    roll_deg: float = 90.0
    distances: tuple[float, float] = (220.0, 285.0)

    def board_poses(self, count, rng):
        """Draw camera_from_board: the camera leans over the board within the cone."""
        return [self._board_pose(rng) for _ in range(count)]

    def _board_pose(self, rng):
        lean = np.radians(self.cone_deg) * np.sqrt(rng.uniform())
        about = rng.uniform(0.0, 2.0 * np.pi)
        turn = (Rotation.from_rotvec(lean * np.array([np.cos(about), np.sin(about), 0.0]))
                * Rotation.from_euler("z", rng.uniform(-1, 1) * self.roll_deg, degrees=True)
                * Rotation.from_rotvec([np.pi, 0.0, 0.0]))
        aim = np.array([*rng.uniform(-12.0, 12.0, 2), rng.uniform(*self.distances)])
        return Transform.from_parts(turn.as_matrix(), aim - turn.apply(self.corners.mean(axis=0)))

    def session(self, rng, count=15, poses=None):
        """Record a session: reached base_from_flange (noisy), and the corners seen."""
        poses = self.board_poses(count, rng) if poses is None else poses
        flanges = [self._flange(pose) for pose in poses]
        reported = [self._reported(flange, rng) for flange in flanges]
        views = [self._seen(pose, rng) for pose in poses]
        return Session(self, reported, views)

    def _seen(self, camera_from_board, rng):
        """Keep the corners that fall on the image."""
        pixels = self.camera.project(camera_from_board @ self.corners)
        pixels = pixels + rng.normal(0.0, self.noise_px, pixels.shape)
        inside = ((pixels > 4) & (pixels < np.array(self.camera.image_size) - 5)).all(axis=1)
        return BoardView(self.corners[inside], pixels[inside])

    def _flange(self, camera_from_board):
        reference_from_carrier = (self.reference_from_board @ camera_from_board.inverse
                                  @ self.carrier_from_camera.inverse)
        return reference_from_carrier if self.mount == "flange" else reference_from_carrier.inverse

    def _reported(self, base_from_flange, rng):
        step = np.concatenate([rng.normal(0.0, np.radians(self.noise_deg), 3),
                               rng.normal(0.0, self.noise_mm, 3)])
        return base_from_flange @ nudge(Transform.identity(), step)

    def point_error(self, carrier_from_camera):
        """How far (mm, rms) the working volume is carried wrongly."""
        points = VOLUME + np.array([0.0, 0.0, WORKING_DISTANCE])
        gap = carrier_from_camera @ points - self.carrier_from_camera @ points
        return float(np.sqrt(np.mean(np.sum(gap ** 2, axis=1))))


@dataclass(frozen=True)
class Session:
    """What a robot and a camera wrote down."""

    world: World
    flanges: list
    views: list

    def problem(self, camera=None):
        """Form the problem as a calibrator sees it."""
        boards = locate_boards(self.views, camera or self.world.camera)
        views = tuple(HandEyeView(*pair) for pair in zip(self.flanges, boards, strict=True))
        return HandEyeProblem(views, self.world.mount, RobotNoise())

    def as_recorded(self, camera=None):
        """Hand it over as a calibrator gets it."""
        return HandEyeSession.seen(stack(self.flanges), tuple(self.views),
                                   camera or self.world.camera, self.world.mount)


def plan(world, rng, count):
    """Choose poses greedily, from a belief that is centimetres and degrees off."""
    candidates = world.board_poses(200, rng)
    camera = nudge(world.carrier_from_camera, rng.normal(0.0, [0.1] * 3 + [10.0] * 3))
    board_pose = nudge(world.reference_from_board, rng.normal(0.0, [0.1] * 3 + [20.0] * 3))
    views = tuple(HandEyeView(board_pose @ pose.inverse @ camera.inverse, _believed(world, pose))
                  for pose in candidates)
    chosen = plan_views(HandEyeProblem(views), camera, board_pose, WORKING_DISTANCE, count)
    return [candidates[index] for index in chosen]


def _believed(world, pose):
    pixels = world.camera.project(pose @ world.corners)
    inside = ((pixels > 4) & (pixels < np.array(world.camera.image_size) - 5)).all(axis=1)
    points = world.corners[inside]
    information = pose_information(points, pose, world.camera, 0.1)
    return BoardPose(pose, np.linalg.inv(information), points, np.zeros((len(points), 2)))


def plain_reprojection(session):
    """Solve as is usual: least squares of the pixels, the robot taken as exact."""
    problem = session.problem()
    camera = solve_park(problem.reference_from_carrier, problem.camera_from_board)
    board_pose = (Transform(problem.reference_from_carrier[0]) @ camera
                  @ problem.views[0].board.camera_from_board)
    poses = [Transform(pose).inverse for pose in problem.reference_from_carrier]

    def miss(step):
        back, target = nudge(camera, step[:6]).inverse, nudge(board_pose, step[6:])
        seen = [session.world.camera.project(back @ pose @ target @ view.points_in_board)
                - view.pixels for pose, view in zip(poses, session.views, strict=True)]
        return np.concatenate(seen).ravel()

    return nudge(camera, least_squares(miss, np.zeros(12), x_scale="jac").x[:6])
