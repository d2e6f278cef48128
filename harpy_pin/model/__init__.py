"""The robot: its states, kinematics, dynamics and contact forces as maps of what it is commanded."""
