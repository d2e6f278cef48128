"""The reduced-order model of the paper, and the governors that act on its force."""
