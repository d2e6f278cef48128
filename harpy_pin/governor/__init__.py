"""Reference governors: they bend a reference so that constraints hold, without solving an optimisation."""

from harpy_pin.governor.base import Governor, GovernorStatus
from harpy_pin.governor.command import CommandGovernorParameters, GovernedGait
from harpy_pin.governor.contact import ContactForceGovernor, ContactGovernorParameters
from harpy_pin.governor.reduced.cone import ConeGovernor
from harpy_pin.governor.reduced.erg import ExplicitReferenceGovernor
from harpy_pin.governor.reduced.margin import MarginGovernor
from harpy_pin.governor.reduced.polar import PolarAngleRow, PolarRows
from harpy_pin.governor.reduced.projection import project_batch
from harpy_pin.governor.reduced.rows import AngleRow, ConstraintRows, ForceRows, StackedRows
from harpy_pin.governor.shield import Shield, ShieldReport
from harpy_pin.governor.shield_batch import ShieldBatch, ShieldBatchReport

__all__ = [
    "AngleRow",
    "CommandGovernorParameters",
    "ConeGovernor",
    "ConstraintRows",
    "ContactForceGovernor",
    "ContactGovernorParameters",
    "ExplicitReferenceGovernor",
    "ForceRows",
    "GovernedGait",
    "Governor",
    "GovernorStatus",
    "MarginGovernor",
    "PolarAngleRow",
    "PolarRows",
    "Shield",
    "ShieldBatch",
    "ShieldBatchReport",
    "ShieldReport",
    "StackedRows",
    "project_batch",
]
