"""A hand-eye session as it was recorded: what a diagnosis starts from."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from cell.core.geometry import Array, Transform
from cell.core.optics import CameraModel
from cell.metrology.calibrate.board_pose import BoardPose, BoardView, locate_boards
from cell.metrology.calibrate.hand_eye.solve import HandEyeProblem, HandEyeView, Mount, RobotNoise

POSE_ONLY = np.diag(np.repeat([np.radians(0.1), 1.0], 3) ** 2)
"""What a board pose is worth that came without its corners: (0.1 degrees)², (1 mm)²."""


@dataclass(frozen=True, eq=False)
class HandEyeSession:
    """Robot poses and board poses, one a view, believed to belong together.

    `base_from_flange` (n, 4, 4). `views` and `camera` are absent in a session of poses alone.
    `after` (n, 4, 4) are the robot poses read again after the exposures, where they were.
    `numbers` are the views' names in sentences, counted from 0 where none are given.
    """

    base_from_flange: Array
    boards: tuple[BoardPose, ...]
    mount: Mount
    views: tuple[BoardView, ...] = ()
    camera: CameraModel | None = None
    after: Array | None = None
    numbers: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", self.numbers or tuple(range(len(self.boards))))

    @classmethod
    def seen(cls, base_from_flange: Array, views: tuple[BoardView, ...], camera: CameraModel,
             mount: Mount, after: Array | None = None) -> HandEyeSession:
        """Build from corners, locating the board in each view.

        Raises:
            UnmeasurableError: a view that carries no board pose.
        """
        return cls(base_from_flange, tuple(locate_boards(views, camera)), mount, views, camera,
                   after)

    @classmethod
    def of_poses(cls, base_from_flange: Array, camera_from_board: Array,
                 mount: Mount) -> HandEyeSession:
        """Build from board poses alone (n, 4, 4)."""
        boards = tuple(BoardPose(Transform(pose), POSE_ONLY, np.zeros((1, 3)), np.zeros((1, 2)))
                       for pose in camera_from_board)
        return cls(base_from_flange, boards, mount)

    def __len__(self) -> int:
        return len(self.boards)

    @property
    def board_middle(self) -> Array:
        """The middle (3,) of the corners, in the board frame."""
        return np.concatenate([board.points_in_board for board in self.boards]).mean(axis=0)

    @property
    def working_distance(self) -> float:
        """How far (mm) the middle of the board was from the camera, on average."""
        middle = self.board_middle
        return float(np.mean([(board.camera_from_board @ middle)[2] for board in self.boards]))

    @property
    def pnp_rms_px(self) -> float:
        """The distance between seen and projected corners over all views, root mean square."""
        residuals = np.concatenate([board.residuals for board in self.boards])
        return float(np.sqrt(np.mean(np.sum(residuals ** 2, axis=1))))

    def problem(self, noise: RobotNoise) -> HandEyeProblem:
        """Form the problem as it stands: nothing is reinterpreted."""
        views = tuple(HandEyeView(Transform(pose), board)
                      for pose, board in zip(self.base_from_flange, self.boards, strict=True))
        return HandEyeProblem(views, self.mount, noise)

    def with_camera(self, camera: CameraModel) -> HandEyeSession:
        """Locate the boards again with another camera."""
        return replace(self, boards=tuple(locate_boards(self.views, camera)), camera=camera)

    def numbered(self, numbers: tuple[int, ...]) -> HandEyeSession:
        """Give the views their names."""
        return replace(self, numbers=numbers)

    def mounted(self, mount: Mount) -> HandEyeSession:
        """Take the camera as mounted otherwise."""
        return replace(self, mount=mount)

    def without(self, indices: Collection[int]) -> HandEyeSession:
        """Leave out some views."""
        keep = [index for index in range(len(self)) if index not in indices]
        return replace(self, base_from_flange=self.base_from_flange[keep],
                       boards=tuple(self.boards[index] for index in keep),
                       views=tuple(self.views[index] for index in keep if self.views),
                       after=None if self.after is None else self.after[keep],
                       numbers=tuple(self.numbers[index] for index in keep))
