"""Pairs as folders, laid out as the reference images are."""

import json

import cv2


def write_pair(folder, number, pair):
    """Write a pair to `folder/NNN`, and its sensor to `folder/sensors`."""
    place = folder / f"{number:03d}"
    place.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(place / "hole.png"), pair.hole)
    cv2.imwrite(str(place / "stripe.png"), pair.stripe)
    (place / "truth.json").write_text(json.dumps(pair.truth, indent=1) + "\n")
    sensors = folder / "sensors"
    sensors.mkdir(exist_ok=True)
    (sensors / f"{pair.sensor.name}.yaml").write_text(pair.sensor.as_yaml())
