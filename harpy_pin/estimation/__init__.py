"""State of a robot from what it feels: inertial unit, encoders and motor torques."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
