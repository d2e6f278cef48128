"""The plant: ground, contact step, simulator, and the log of what happened."""
