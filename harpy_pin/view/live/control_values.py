"""Values that a page sends for its controls: what no control of ours can have is refused before viser takes it."""

from __future__ import annotations

from typing import Any

from viser import GuiButtonGroupHandle, GuiCheckboxHandle, GuiDropdownHandle, GuiSliderHandle

from harpy_pin import checks
from harpy_pin.errors import InputError

__all__ = ["check_value"]


def check_value(handle: Any, value: object) -> None:
    """Refuse what this control cannot be set to.

    Args:
        handle: viser's, of a control.
        value: as it came from a page.

    Raises:
        InputError: no option of the control, no number within its ends, or neither true nor false.
    """
    label = handle.label or "control"
    if isinstance(handle, GuiDropdownHandle | GuiButtonGroupHandle):
        if not isinstance(value, str):
            raise InputError(f"{label} must be a name, got {value!r:.60}", name=label, value=value)
        checks.one_of(f"option of {label}", value[:60], handle.options)
    elif isinstance(handle, GuiSliderHandle):
        _check_number(label, value, handle)
    elif isinstance(handle, GuiCheckboxHandle) and not isinstance(value, bool):
        raise InputError(f"{label} must be true or false, got {value!r:.60}", name=label, value=value)


def _check_number(label: str, value: object, slider: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{label} must be a number, got {value!r:.60}", name=label, value=value)
    number = checks.number(label, value, low=slider.min, high=slider.max)
    if isinstance(slider.value, int):
        checks.whole(label, int(number) if number.is_integer() else value)
