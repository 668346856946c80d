"""Names of the topics of an experiment, relative to the namespace."""

NAMESPACE = '/porotwin'
"""Namespace of imported experiments. A reader accepts every namespace."""

RIG = 'rig/description'
SETPOINT = 'wells/setpoint'
MEASURED = 'wells/measured'
NEW_STATE = 'asset/new_state'
STATE_REFRESHED = 'asset/state_refreshed'
CLEAN_STATE = 'asset/clean_state'
EFFECTS = 'model/effects'
OFFER = 'mend/offer'
IMAGE = 'camera/image/compressed'
BASELINE = 'camera/baseline/compressed'
CYCLE = 'hub/cycle'
