"""What a block looks like: curves of that very block, run from its binary, as icon and as figures."""
