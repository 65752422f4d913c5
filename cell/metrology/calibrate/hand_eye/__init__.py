"""Hand-eye: where the camera sits on the flange, and whether to believe it."""
