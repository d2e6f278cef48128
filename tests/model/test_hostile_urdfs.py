"""URDFs with attributes, elements and bytes changed: a robot that simulates, or one line of ours, in silence.

``--fuzz 20`` is 2,000 files.
"""

from __future__ import annotations

import numpy as np
from entrances import CONTROLLERS, few_ticks
from hostile import outcome, spoil_urdf

import harpy_pin as hp

FILES = 100


def test_hostile_files(robot, tmp_path, capfd, fuzz):
    rng = np.random.default_rng(1)
    text, path = robot.urdf.read_text(), tmp_path / "hostile.urdf"
    read = 0
    for k in range(FILES * fuzz):
        path.write_bytes(spoil_urdf(rng, text))
        made, _ = outcome(hp.load_harpy, path)
        assert capfd.readouterr() == ("", "")
        if made is None:
            continue
        read += 1
        if k % 4 == 0:
            outcome(few_ticks, path, CONTROLLERS[k % 3])
            capfd.readouterr()
    assert 0.1 * FILES * fuzz < read < 0.9 * FILES * fuzz


SHAPES = (
    "<visual/>",
    "<collision/>",
    "<visual><geometry/></visual>",
    "<visual><geometry><capsule radius='1' length='1'/></geometry></visual>",
    "<visual><geometry><box size='1 1 1'/></geometry><material/></visual>",
    "<visual><geometry><mesh/></geometry></visual>",
)


def test_shapes_that_no_reader_knows_are_read_over_in_silence(robot, tmp_path, capfd):
    """They are no part of the model: Pinocchio's reader tells of each on standard error."""
    path = tmp_path / "shapes.urdf"
    for shape in SHAPES:
        path.write_text(robot.urdf.read_text().replace('<link name="base">', f'<link name="base">{shape}', 1))
        assert hp.load_harpy(path).model == robot.model
        assert capfd.readouterr() == ("", "")
    path.write_text(robot.urdf.read_text().replace("</robot>", "<material/><material name='a'/></robot>"))
    assert hp.load_harpy(path).model == robot.model
    assert capfd.readouterr() == ("", "")
