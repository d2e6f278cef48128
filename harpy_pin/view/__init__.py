"""View: runs replayed in the browser, as an HTML file or a picture, and figures of their signals."""

from harpy_pin.view.figures import figures_of
from harpy_pin.view.identity import robot_of
from harpy_pin.view.page.replay import ReplayServer, replay_html, show, write_html

__all__ = ["ReplayServer", "figures_of", "replay_html", "robot_of", "show", "write_html"]
