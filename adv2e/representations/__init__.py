"""What networks are given in the place of events: grids and pictures of the events of a window."""
