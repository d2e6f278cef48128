"""A viewer of a live page that is no browser."""

from typing import Any

from harpy_pin.contrib.live.live_page import EYE, MIDDLE

CAMERA: dict[str, Any] = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": list(EYE),
    "image_height": 400,
    "image_width": 800,
    "fov": 0.7,
    "near": 0.1,
    "far": 100.0,
    "look_at": list(MIDDLE),
    "up_direction": [0.0, 0.0, 1.0],
}
"""What a page says first."""


def connected(url: str) -> Any:
    """A connection to a page's server."""
    import viser
    from websockets.sync.client import connect

    protocol: Any = f"viser-v{viser.__version__}"
    return connect(url.replace("http", "ws"), subprotocols=[protocol], max_size=None)
