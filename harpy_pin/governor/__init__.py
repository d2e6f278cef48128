"""Reference governors: they bend a reference so that constraints hold, without solving an optimisation."""

from harpy_pin.governor.base import Governor, GovernorStatus
from harpy_pin.governor.contact import ContactForceGovernor, ContactGovernorParameters
from harpy_pin.governor.explicit import ExplicitReferenceGovernor
from harpy_pin.governor.polar import PolarAngleRow, PolarRows
from harpy_pin.governor.rows import AngleRow, ConstraintRows, ForceRows, StackedRows

__all__ = [
    "AngleRow",
    "ConstraintRows",
    "ContactForceGovernor",
    "ContactGovernorParameters",
    "ExplicitReferenceGovernor",
    "ForceRows",
    "Governor",
    "GovernorStatus",
    "PolarAngleRow",
    "PolarRows",
    "StackedRows",
]
