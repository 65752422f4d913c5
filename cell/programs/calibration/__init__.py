"""The wizard: camera, light plane, hand-eye and body registration, ending in one set."""
