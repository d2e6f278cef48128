"""View: a run replayed in the browser, as an HTML file or a picture, and figures of its signals."""

from harpy_pin.view.figures.walk_figures import command_figure, forces_figure, reference_figure, thrust_figure
from harpy_pin.view.page.replay import ReplayServer, replay_html, replays_html, show, write_html, write_replays
from harpy_pin.view.robot_of import robot_of
from harpy_pin.view.scene.frames import Frames
from harpy_pin.view.scene.scene import Scene, scene_of

__all__ = [
    "Frames",
    "ReplayServer",
    "Scene",
    "command_figure",
    "forces_figure",
    "reference_figure",
    "replay_html",
    "replays_html",
    "robot_of",
    "scene_of",
    "show",
    "thrust_figure",
    "write_html",
    "write_replays",
]
