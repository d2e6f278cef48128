"""Controllers as portable C (docs/embedded.md)."""

from harpy_pin.export.exported_controllers import Exportable, exportable
from harpy_pin.export.folder import Exported, export, write_folder
from harpy_pin.export.recording import CONTROLLERS

__all__ = ["CONTROLLERS", "Exportable", "Exported", "export", "exportable", "write_folder"]
