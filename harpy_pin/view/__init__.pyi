"""What ``harpy_pin.view`` offers; :mod:`lazy_loader` reads this file."""

from .figures import figures_of
from .identity import robot_of
from .page.replay import InlineReplay, ReplayServer, replay_html, show, write_html
from .viewer.viewer import Viewer

__all__ = [
    "InlineReplay",
    "ReplayServer",
    "Viewer",
    "figures_of",
    "replay_html",
    "robot_of",
    "show",
    "write_html",
]
