"""Camera, light plane, arm and hand-eye from views of a board; spheres as a check."""
