"""What ``harpy_pin.governors`` offers; :mod:`lazy_loader` reads this file."""

from .contact_force_filter import ContactForceFilter
from .contact_force_parameters import ContactForceFilterParameters
from .erg import ExplicitReferenceGovernor, PaperGovernorParameters
from .governor import Governor, GovernorStatus
from .rows import ConstraintRows, ForceRows, StackedRows
from .thrust import AttitudeGains, CentreGains

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
