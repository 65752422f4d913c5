"""The virtual cell: an emulated UR controller, a scene with its own truth, a camera for it."""
