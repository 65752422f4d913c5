"""From a picture to pixels: the rim of a hole, the stripe, and which of them belong together."""
