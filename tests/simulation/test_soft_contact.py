"""MuJoCo's own contact: what its presets are, how it creeps, and feet that are spheres."""

import mujoco
import numpy as np
import pytest
from walks import put

import harpy_pin as hp
from comparison.studies.contacts import creep
from harpy_pin import Command, Ground, Mujoco, Scenario
from harpy_pin.simulation.mujoco import CONTACTS, MujocoPlant

NOTHING = Command(np.zeros(0), np.zeros((0, 3)))
WEIGHT = 2.0 * 9.81


def rest(sled, contact, mu, angle, heading=0.0):
    """The sled after two seconds on a slope that falls towards a heading."""
    slope = (np.sin(angle) * np.cos(heading), np.sin(angle) * np.sin(heading), -np.cos(angle))
    plant = put(MujocoPlant(sled, Ground(mu_s=mu), gravity=9.81 * np.array(slope), contact=contact))
    plant.advance(NOTHING, steps=4000)
    return plant


def test_default_is_what_mujoco_sets_itself(sled):
    """A model in which nothing is set has the same numbers in its contact pairs and options."""
    spec = mujoco.MjSpec()
    for name in ("a", "b"):
        body = spec.worldbody.add_body(
            name=name, mass=1.0, inertia=(1, 1, 1), explicitinertial=True
        )
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.1, 0, 0))
    spec.add_pair(geomname1="a", geomname2="b")
    bare = spec.compile()
    ours = MujocoPlant(sled, contact=CONTACTS["default"]).model
    for name in ("pair_solref", "pair_solimp", "pair_solreffriction", "pair_margin", "pair_gap"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(bare, name), err_msg=name)
    names = (
        "cone",
        "impratio",
        "tolerance",
        "iterations",
        "solver",
        "integrator",
        "disableflags",
        "noslip_iterations",
    )
    for name in names:
        assert getattr(ours.opt, name) == getattr(bare.opt, name), name


@pytest.mark.parametrize("name", CONTACTS)
@pytest.mark.parametrize("mu", [0.25, 0.8])
@pytest.mark.parametrize("share", [0.2, 0.9])
def test_a_block_inside_the_cone_creeps_as_the_closed_form_says(sled, name, mu, share):
    contact = CONTACTS[name]
    plant = rest(sled, contact, mu, np.arctan(share * mu))
    force, before = plant.state.foot_force[0], plant.q[0]
    assert force[0] == pytest.approx(-WEIGHT * np.sin(np.arctan(share * mu)), rel=1e-5)
    plant.advance(NOTHING, steps=2000)
    (inverse,) = plant.inverse_mass
    assert inverse == pytest.approx(0.5)
    velocity = creep(contact, force, -plant.q[2], inverse_mass=inverse, friction=mu)
    assert velocity[1] == 0.0
    assert plant.q[0] - before == pytest.approx(velocity[0], rel=1e-3)
    assert velocity[0] > 1e-6


@pytest.mark.parametrize("heading", [0.3, 0.6, 2.0])
def test_a_pyramid_creeps_along_its_edges_one_by_one(sled, heading):
    """Across the edges the velocity is not along the force, and each axis has its own."""
    contact, mu = CONTACTS["default"], 0.5
    plant = rest(sled, contact, mu, np.arctan(0.6 * mu), heading)
    force, before = plant.state.foot_force[0], plant.q[:2].copy()
    plant.advance(NOTHING, steps=2000)
    velocity = creep(contact, force, -plant.q[2], inverse_mass=0.5, friction=mu)
    np.testing.assert_allclose(plant.q[:2] - before, velocity, rtol=1e-3)


@pytest.mark.parametrize("name", CONTACTS)
@pytest.mark.parametrize("mu", [0.25, 0.8])
def test_a_block_rests_at_the_depth_of_the_ground_that_is_said(sled, name, mu):
    plant = rest(sled, CONTACTS[name], mu, 0.0)
    assert -plant.q[2] == pytest.approx(plant.static_penetration, rel=1e-4)
    assert plant.ground.stiffness * -plant.q[2] == pytest.approx(WEIGHT, rel=1e-4)
    holds = CONTACTS[name].normal_force(-plant.q[2], inverse_mass=0.5, friction=mu)
    assert holds == pytest.approx(WEIGHT, rel=1e-4)


def test_damping_is_that_of_a_body_that_is_pushed_down(sled):
    """The contact has an inertia 1 / R beside its damper b / R, so that a body at speed v is held
    by b v / (A + R).
    """
    contact, speed = CONTACTS["elliptic"], 1e-4
    plant = rest(sled, contact, 0.5, 0.0)
    plant.reset(plant.q, np.array([0.0, 0.0, -speed, 0.0, 0.0, 0.0]))
    plant.advance(NOTHING)
    r = contact.damping_rate / plant.ground.damping
    more = (plant.state.foot_force[0, 2] - WEIGHT) / speed
    assert more == pytest.approx(plant.ground.damping * r / (0.5 + r), rel=0.01)


@pytest.mark.parametrize("plant", [Mujoco("default"), Mujoco("menagerie", foot_radius=0.02)])
def test_presets_and_spheres_are_logged(plant):
    about = hp.walk(Scenario(plant=plant, duration=0.05)).metadata["plant"]
    assert about["solimp"] == list(CONTACTS[plant.preset].solimp)
    assert about["cone"] == CONTACTS[plant.preset].cone
    assert about.get("foot_radius", 0.0) == plant.foot_radius


def test_what_slips_under_the_condensed_wbc_on_the_default_contact_is_its_creep():
    """No controller can hold a foot that creeps; this one adds nothing of its own."""
    walk = hp.build(Scenario(plant=Mujoco("default"), ground=Ground(mu_s=0.25), duration=3.0))
    run = walk.run()
    force, depth = run["foot_force"], -run["foot_position"][:, :, 2]
    velocity = creep(
        CONTACTS["default"], force, depth, inverse_mass=walk.simulator.inverse_mass, friction=0.25
    )
    way = 1e-3 * np.linalg.norm(velocity, axis=2)[force[:, :, 2] > 0.0].sum()
    assert run["slip_path"][-1].sum() == pytest.approx(way, rel=0.02)
