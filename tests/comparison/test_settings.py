"""Settings of the studies: what is out of their domain is refused by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from comparison.campaign.settings import CampaignSettings
from comparison.delay import DelaySettings
from comparison.edge import EdgeSettings
from comparison.ice import IceSettings
from comparison.jitter import JitterSettings
from comparison.limits import LimitsSettings
from comparison.public.study import PublicSettings
from comparison.robots import RobotsSettings
from comparison.sections.grounds import GroundsSettings
from comparison.steering import SteeringSettings
from comparison.thrusters import ThrusterSettings
from comparison.walking import WalkingSettings
from harpy_pin import InputError

BAD: dict[type, dict[str, tuple[Any, ...]]] = {
    CampaignSettings: {
        **{"walks": (0,), "duration": (1.0,), "seed": (-1,), "frictions": ((-0.1,),), "mass_errors": ((-1.0,),)},
        **{"jitter": (np.nan,), "plants": (("gazebo",),), "contenders": (("wbc/full",),), "stiffnesses": ((0.0,),)},
        **{"dampings": ((-1.0,),), "speeds": ((0.0,),)},
    },
    DelaySettings: {"frictions": ((-0.1,),)},
    EdgeSettings: {"frictions": ((-0.1,),)},
    GroundsSettings: {"duration": (0.0,)},
    IceSettings: {"walks": (0,)},
    JitterSettings: {"priority": (100,)},
    LimitsSettings: {"gaits": (("moonwalk",),), "torque": ((0.0,),), "starts": (0,), "frictions": ((-0.1,),)},
    PublicSettings: {"problems": (0,), "repetitions": (0,)},
    RobotsSettings: {"robots": (("harpy",),), "pushes": ((), (0.2, 0.1)), "duration": (0.1,)},
    SteeringSettings: {"walks": (-1,), "pushes": ((-1.0,),)},
    ThrusterSettings: {
        "lags": ((-0.1,),),
        "turning_lags": ((-0.1,),),
        "failing": ((1.5,),),
        "bandwidths": ((0.0,),),
        "plants": (("gazebo",),),
        "starts": (0,),
    },
    WalkingSettings: {"robots": (("iris",),), "walks": (-1,), "duration": (1.0,), "course": (0.0,)},
}
"""By settings and entry, values that each of them refuses."""


@pytest.mark.parametrize("settings", BAD)
def test_settings_out_of_their_domain(settings: type) -> None:
    for name, values in BAD[settings].items():
        for value in values:
            with pytest.raises(InputError) as caught:
                settings(**{name: value})
            assert name.rstrip("s").split("_")[0][:8] in str(caught.value), caught.value
