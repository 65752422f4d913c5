"""Calibration targets as the camera sees them: ChArUco boards and matt spheres."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from cell.core.geometry import Array, Transform
from cell.sim.materials import FINISHES
from cell.sim.render_face import Face, Layer, covered, ring_light, stripe_light
from cell.sim.render_lens import Lens, Light
from cell.sim.render_light import Lamps
from cell.sim.scene import Board, Sphere

PRINT_TEXELS = 200   # along each side of a square of a board
INK, PAPER = 0.10, 1.0
FINISH = "ceramic"


def render_board(lens: Lens, lamps: Lamps, camera_from_board: Transform,
                 board: Board) -> Layer | None:
    """Render a ChArUco board, or nothing where it is out of sight or seen from behind."""
    squares = np.array(board.squares) * board.square_mm
    middle = Transform.from_parts(np.diag([1.0, -1.0, -1.0]), [*squares / 2.0, 0.0])
    face, half = Face(camera_from_board @ middle), squares / 2.0 + board.margin_mm
    if not face.in_sight(lens, half):
        return None
    depth, u, v = face.places(lens.rays)
    light = ring_light(lens, lamps, face, FINISH)
    if lamps.laser:
        light += stripe_light(lens, lamps, FINISH, depth)
    light *= _printed(board, u + squares[0] / 2.0, squares[1] / 2.0 - v)
    return Layer(light, covered(lens, u, v, half, depth), face.distance)


def render_sphere(lens: Lens, lamps: Lamps, camera_from_base: Transform,
                  sphere: Sphere) -> Layer | None:
    """Render a matt ceramic sphere, or nothing where it is out of sight."""
    centre = camera_from_base @ np.array(sphere.centre)
    if centre[2] < sphere.radius or not _near_view(lens, centre, sphere.radius):
        return None
    rays = lens.rays
    length2 = rays.x**2 + rays.y**2 + 1.0
    along = rays.along(centre) / length2
    miss2 = np.maximum(float(centre @ centre) - along**2 * length2, 0.0)
    inside = np.maximum(sphere.radius**2 - miss2, 0.0)
    depth = along - np.sqrt(inside / length2)
    pixel = centre[2] / lens.sensor.camera.matrix[0, 0]
    cover = np.clip(0.5 + (sphere.radius - np.sqrt(miss2)) / pixel, 0.0, 1.0).astype(np.float32)
    light = np.zeros(lens.shape, np.float32)
    hit = cover > 0.0
    light[hit] = _sphere_light(lens, lamps, centre, sphere.radius, depth, hit)
    return Layer(light, cover, float(centre[2]))


def _sphere_light(lens: Lens, lamps: Lamps, centre: Array, radius: float, depth: Array,
                  hit: Array) -> Light:
    points = np.stack([lens.rays.x[hit] * depth[hit], lens.rays.y[hit] * depth[hit], depth[hit]],
                      axis=-1)
    normal = (points - centre) / radius
    light = lamps.ring_on(points, normal, FINISHES[FINISH]).astype(np.float32)
    if lamps.laser:
        way = lamps.laser_at - points
        facing = np.maximum(np.sum(way * normal, axis=-1) / np.linalg.norm(way, axis=-1), 0.0)
        light += facing * stripe_light(lens, lamps, FINISH, depth)[hit]
    return light


def _near_view(lens: Lens, centre: Array, radius: float) -> bool:
    height, width = lens.shape
    u, v = lens.sensor.camera.project(centre)
    reach = 1.1 * radius / centre[2] * lens.sensor.camera.matrix[0, 0]
    return bool(-reach < u < width + reach and -reach < v < height + reach)


def _printed(board: Board, x: Array, y: Array) -> Light:
    """Return the brightness of the print at places on the board (mm), white around it."""
    texels = PRINT_TEXELS / board.square_mm
    return cv2.remap(_print(board), (x * texels - 0.5).astype(np.float32),
                     (y * texels - 0.5).astype(np.float32), cv2.INTER_LINEAR,
                     borderMode=cv2.BORDER_CONSTANT, borderValue=PAPER)


@lru_cache(maxsize=4)
def _print(board: Board) -> Light:
    """Draw the squares and markers, softened over half a pixel of the camera."""
    aruco = cv2.aruco
    dictionary = aruco.getPredefinedDictionary(getattr(aruco, board.dictionary))
    drawn = aruco.CharucoBoard(board.squares, board.square_mm, board.marker_mm, dictionary)
    columns, rows = board.squares
    image = drawn.generateImage((columns * PRINT_TEXELS, rows * PRINT_TEXELS), marginSize=0)
    ink = INK + (PAPER - INK) * image.astype(np.float32) / 255.0
    return cv2.blur(ink, (3, 3), borderType=cv2.BORDER_REPLICATE)
