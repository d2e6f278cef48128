"""The paper, reproduced: its two simulations, its claims with verdict and number, and a report."""
