"""From pixels to a circle in the camera frame and its uncertainty; the paper's method beside it."""
