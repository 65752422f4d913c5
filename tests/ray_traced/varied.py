"""The same scene through another chain: gain, gamma, flips, JPEG; the truth goes with it."""

from dataclasses import replace

import cv2
import numpy as np

from ray_traced.detector import WHITE


def vary(pair, seed):
    """Vary a pair as a seed says."""
    rng = np.random.default_rng([seed, 5])
    left_right, top_bottom = (bool(side) for side in rng.integers(0, 2, 2))
    most = 1.0 if "clipped" in pair.truth["tags"] else 1.2  # what is clipped is not clipped more
    chain = {"gain": round(rng.uniform(0.8, most), 3), "gamma": round(rng.uniform(0.8, 1.25), 3),
             "flip_x": left_right, "flip_y": top_bottom,
             "jpeg": int(rng.integers(90, 101)) if rng.random() < 0.5 else None}
    sensor = pair.sensor.mirrored(left_right, top_bottom)
    mirror = np.array([-1.0 if left_right else 1.0, -1.0 if top_bottom else 1.0, 1.0])
    nominal = {**pair.truth["nominal"], "normal": (mirror * pair.truth["nominal"]["normal"])
               .tolist()}
    truth = {**pair.truth, "sensor": sensor.name, "varied": chain, "nominal": nominal,
             "centre_mm": (mirror * pair.truth["centre_mm"]).tolist(),
             "normal": (mirror * pair.truth["normal"]).tolist()}
    return replace(pair, hole=_through(chain, pair.hole), stripe=_through(chain, pair.stripe),
                   truth=truth, sensor=sensor)


def _through(chain, picture):
    grey = WHITE * (picture / WHITE) ** chain["gamma"] * chain["gain"]
    picture = np.clip(np.rint(grey), 0, WHITE).astype(np.uint8)
    picture = picture[::-1 if chain["flip_y"] else 1, ::-1 if chain["flip_x"] else 1]
    if chain["jpeg"]:
        _, packed = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, chain["jpeg"]])
        picture = cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE)
    return np.ascontiguousarray(picture)
