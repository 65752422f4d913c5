"""Run by an interpreter with opencv-contrib, whose package collides with the headless one:
reads images from an .npz on stdin's path, prints the largest ellipse of each as JSON."""

import json
import sys
import time

import cv2
import numpy as np

answers = []
for image in np.load(sys.argv[1])["images"]:
    start = time.process_time()
    drawing = cv2.ximgproc.createEdgeDrawing()
    drawing.detectEdges(image)
    ellipses = drawing.detectEllipses()
    spent = time.process_time() - start
    found = [] if ellipses is None else np.asarray(ellipses).reshape(-1, 6)
    best = max(found, key=lambda e: max(e[2], e[2] + e[3] / 2), default=None)
    answers.append({"centre": None if best is None else best[:2].tolist(), "seconds": spent})
print(json.dumps(answers))
