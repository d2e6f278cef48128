"""Reference governors: they bend a reference so that constraints hold, without solving an optimisation."""

from harpy_pin.governors.contact_force_filter import ContactForceFilter, ContactForceFilterParameters
from harpy_pin.governors.governor import Governor, GovernorStatus
from harpy_pin.governors.reduced.cone import ConeGovernor
from harpy_pin.governors.reduced.erg import ExplicitReferenceGovernor
from harpy_pin.governors.reduced.erg_parameters import PaperGovernorParameters
from harpy_pin.governors.reduced.polar import PolarAngleRow, PolarRows
from harpy_pin.governors.reduced.rows import AngleRow, ConstraintRows, ForceRows, StackedRows
from harpy_pin.governors.shield import Shield, ShieldReport
from harpy_pin.governors.shield_batch import ShieldBatch, ShieldBatchReport

__all__ = [
    "AngleRow",
    "ConeGovernor",
    "ConstraintRows",
    "ContactForceFilter",
    "ContactForceFilterParameters",
    "ExplicitReferenceGovernor",
    "ForceRows",
    "Governor",
    "GovernorStatus",
    "PaperGovernorParameters",
    "PolarAngleRow",
    "PolarRows",
    "Shield",
    "ShieldBatch",
    "ShieldBatchReport",
    "ShieldReport",
    "StackedRows",
]
