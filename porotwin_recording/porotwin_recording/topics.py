"""Names and types of the topics that make up an experiment, relative to the namespace."""

NAMESPACE = '/porotwin'
"""Where import puts an experiment; reading finds the topics in any namespace."""

RIG = 'rig/description'
SETPOINT = 'wells/setpoint'
MEASURED = 'wells/measured'
NEW_STATE = 'asset/new_state'
STATE_REFRESHED = 'asset/state_refreshed'
CLEAN_STATE = 'asset/clean_state'
IMAGE = 'camera/image/compressed'
BASELINE = 'camera/baseline/compressed'
