"""What the cell does: programs over ports and documents."""
