"""Pairs of hole and stripe image, ray-traced: a second renderer, independent of `cell.sim`."""
