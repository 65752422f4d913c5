"""From everything seen of a hole to a result in the body frame, and whether to look again."""
