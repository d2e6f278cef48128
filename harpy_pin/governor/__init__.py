"""Reference governors: they bend a reference so that constraints hold, without solving an optimisation."""

from harpy_pin.governor.barrier import BarrierGovernor
from harpy_pin.governor.base import Governor, GovernorStatus
from harpy_pin.governor.clamp import ClampGovernor
from harpy_pin.governor.cone import ConeGovernor
from harpy_pin.governor.contact import ContactForceGovernor, ContactGovernorParameters
from harpy_pin.governor.explicit import ExplicitReferenceGovernor
from harpy_pin.governor.margin import MarginGovernor
from harpy_pin.governor.polar import PolarAngleRow, PolarRows
from harpy_pin.governor.projection import project_batch
from harpy_pin.governor.rows import AngleRow, ConstraintRows, ForceRows, StackedRows

__all__ = [
    "AngleRow",
    "BarrierGovernor",
    "ClampGovernor",
    "ConeGovernor",
    "ConstraintRows",
    "ContactForceGovernor",
    "ContactGovernorParameters",
    "ExplicitReferenceGovernor",
    "ForceRows",
    "Governor",
    "GovernorStatus",
    "MarginGovernor",
    "PolarAngleRow",
    "PolarRows",
    "StackedRows",
    "project_batch",
]
