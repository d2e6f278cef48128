"""The paper's plane: the robot restricted to it, its walk, and the search for a gait."""
