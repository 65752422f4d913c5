"""Studies of the cell as a measuring system: how it repeats, drifts and differs from a CMM."""
