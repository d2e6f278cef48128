"""Flight: jumping, hovering, and flying from place to place, for robots with feet and thrusters or rotors."""

__all__: list[str] = []
