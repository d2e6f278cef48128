"""Settings of the studies: what is out of their domain is refused by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from comparison.campaign.settings import CampaignSettings
from harpy_pin import InputError

BAD: dict[type, dict[str, tuple[Any, ...]]] = {
    CampaignSettings: {
        **{"walks": (0,), "duration": (1.0,), "seed": (-1,), "frictions": ((-0.1,),), "mass_errors": ((-1.0,),)},
        **{"jitter": (np.nan,), "plants": (("gazebo",),), "contenders": (("wbc/full",),), "stiffnesses": ((0.0,),)},
        **{"dampings": ((-1.0,),), "speeds": ((0.0,),)},
    }
}
"""By settings and entry, values that each of them refuses."""


@pytest.mark.parametrize("settings", BAD)
def test_settings_out_of_their_domain(settings: type) -> None:
    for name, values in BAD[settings].items():
        for value in values:
            with pytest.raises(InputError) as caught:
                settings(**{name: value})
            assert name.rstrip("s").split("_")[0][:8] in str(caught.value), caught.value
