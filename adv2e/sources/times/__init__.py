"""When frames are taken: lists, names, rates, units and gaps."""
