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

DOUBTFUL = '_doubtful'
"""Last part of the name of a topic with messages that a foreign node could have sent."""

TYPES = {
    '/clock': 'rosgraph_msgs/msg/Clock',
    BASELINE: 'sensor_msgs/msg/CompressedImage',
    CLEAN_STATE: 'porotwin_msgs/msg/CleanState',
    CYCLE: 'porotwin_msgs/msg/CycleReport',
    EFFECTS: 'porotwin_msgs/msg/ModelEffects',
    IMAGE: 'sensor_msgs/msg/CompressedImage',
    MEASURED: 'porotwin_msgs/msg/WellRates',
    NEW_STATE: 'porotwin_msgs/msg/NewState',
    OFFER: 'porotwin_msgs/msg/MendOffer',
    RIG: 'porotwin_msgs/msg/RigDescription',
    SETPOINT: 'porotwin_msgs/msg/Setpoint',
    STATE_REFRESHED: 'porotwin_msgs/msg/StateRefreshed',
    'asset/experiment': 'std_msgs/msg/Header',
    'mend/seen': 'std_msgs/msg/Header',
    'siblings/forecast': 'porotwin_msgs/msg/Forecast',
    'tracer/corrected': 'porotwin_msgs/msg/TracerField',
    'tracer/predicted': 'porotwin_msgs/msg/TracerField',
}
"""Types of the topics whose sender matters: no other type is recorded under these names."""
