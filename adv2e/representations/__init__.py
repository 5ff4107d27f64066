"""Event representations for networks: grids and pictures of the events of a window."""
