"""The truth of a virtual cell, drawn from the seed of its scene. The application never sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.core.geometry import Array, Plane, Transform
from cell.core.optics import CameraModel
from cell.sim.arm import TrueArm
from cell.sim.scene import PoseErrors, SceneDocument, SensorErrors, SensorScene


@dataclass(frozen=True, eq=False)
class TrueSensor:
    """The sensor as it really is, with the lamps and the lens of its design."""

    camera: CameraModel
    light_plane: Plane
    design: SensorScene


@dataclass(frozen=True, eq=False)
class World:
    """What does not change from body to body: sensor, its place on the flange, fixture and arm."""

    scene: SceneDocument
    sensor: TrueSensor
    flange_from_camera: Transform
    base_from_fixture: Transform
    arm: TrueArm


def draw_world(scene: SceneDocument) -> World:
    """Draw the true sensor, hand-eye, fixture and arm: the same scene is the same world."""
    return World(
        scene,
        _draw_sensor(scene.sensor, scene.sensor_errors, _chance(scene, "sensor")),
        _moved(Transform(np.array(scene.flange_from_camera)), np.zeros(3),
               scene.hand_eye_errors, _chance(scene, "hand-eye")),
        _moved(Transform(np.array(scene.base_from_fixture)), np.array(scene.bodies.pivot),
               scene.fixture_errors, _chance(scene, "fixture")),
        TrueArm(scene.arm, scene.seed),
    )


def _draw_sensor(design: SensorScene, errors: SensorErrors,
                 chance: np.random.Generator) -> TrueSensor:
    matrix, distortion = np.array(design.camera_matrix), np.array(design.distortion)
    matrix[(0, 1), (0, 1)] *= 1.0 + errors.focal * chance.standard_normal(2)
    matrix[:2, 2] += errors.principal_px * chance.standard_normal(2)
    spread = np.array([errors.k1, errors.k2, errors.tangential, errors.tangential, 0.0])
    distortion = distortion + spread * chance.standard_normal(5)
    plane = _draw_plane(Plane.from_coefficients(design.light_plane), errors, chance)
    return TrueSensor(CameraModel(design.image_size, matrix, distortion), plane, design)


def _draw_plane(plane: Plane, errors: SensorErrors, chance: np.random.Generator) -> Plane:
    """Lean and shift a light plane about the point where the optic axis meets it."""
    middle = np.array([0.0, 0.0, -plane.offset / plane.normal[2]])
    lean = np.radians(errors.plane_deg) * chance.standard_normal(3)
    lean = lean - (lean @ plane.normal) * plane.normal
    normal = plane.normal + lean
    normal = normal / np.linalg.norm(normal)
    return Plane.through(middle + errors.plane_mm * chance.standard_normal() * normal, normal)


def _moved(pose: Transform, pivot: Array, errors: PoseErrors,
           chance: np.random.Generator) -> Transform:
    """Turn a frame about a point of its own, and shift it, along the axes of the outer frame."""
    turn = Transform.from_parts(np.radians(errors.deg) * chance.standard_normal(3), np.zeros(3))
    shift = errors.mm * chance.standard_normal(3)
    there = pose @ pivot
    return Transform.from_parts(turn.rotation @ pose.rotation,
                                turn @ (pose.translation - there) + there + shift)


def _chance(scene: SceneDocument, name: str) -> np.random.Generator:
    return np.random.default_rng([scene.seed, *name.encode()])
