"""Reference governors: they bend a reference so that constraints hold, without solving an
optimisation.
"""

from harpy_pin.governors.contact_force_filter import ContactForceFilter
from harpy_pin.governors.contact_force_parameters import ContactForceFilterParameters
from harpy_pin.governors.erg import ExplicitReferenceGovernor, PaperGovernorParameters
from harpy_pin.governors.governor import Governor, GovernorStatus
from harpy_pin.governors.rows import ConstraintRows, ForceRows, StackedRows
from harpy_pin.governors.thrust import AttitudeGains, CentreGains

__all__ = [
    "AttitudeGains",
    "CentreGains",
    "ConstraintRows",
    "ContactForceFilter",
    "ContactForceFilterParameters",
    "ExplicitReferenceGovernor",
    "ForceRows",
    "Governor",
    "GovernorStatus",
    "PaperGovernorParameters",
    "StackedRows",
]
