"""What is drawn in three dimensions: robot, ground, forces, cones, references."""
