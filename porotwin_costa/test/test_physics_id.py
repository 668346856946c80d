"""The identity of a physics-based model."""

from porotwin_costa.data.physics_id import PhysicsId


def test_the_first_difference_is_named():
    one = PhysicsId('upwind', 'abc')
    assert one.difference(one) == ''
    assert one.difference(PhysicsId('fast', 'abc')) == "preset 'upwind', not 'fast'"
    assert one.difference(PhysicsId('upwind', 'def')).startswith('rig abc, not def')


def test_unknown_fields_are_not_compared():
    assert PhysicsId('upwind', 'abc').difference(PhysicsId()) == ''
    assert not PhysicsId('upwind').known
    assert PhysicsId('upwind', 'abc').known


def test_the_rig_is_identified_by_its_physics(rig):
    other = rig.model_copy(update={'porosity': 0.4})
    assert PhysicsId.of(rig, 'fast') == PhysicsId.of(rig, 'fast')
    assert PhysicsId.of(rig, 'fast').difference(PhysicsId.of(other, 'fast'))
